"""Lines of logs written by hand for the tests of their reader."""

HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
ROW = "a,air_arrival_s,0.05,0.001,20,0,1.5\n"
