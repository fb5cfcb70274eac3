"""Levenberg-Marquardt over lanes: quadratic model, trust region, robust loss."""
