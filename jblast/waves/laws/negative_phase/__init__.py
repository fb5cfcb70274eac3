"""The phase below ambient pressure: Rigby et al., UFC 3-340-02."""
