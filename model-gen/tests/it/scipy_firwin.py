"""Prints tests/it/scipy_firwin.csv: python3 tests/it/scipy_firwin.py > tests/it/scipy_firwin.csv"""
from math import ceil, gcd

import scipy
from scipy import signal

print(f"# scipy {scipy.__version__}: firwin(taps, 62, window=('kaiser', 5), fs=rate * phases), every 29th tap")
print("# rate_hz,phases,taps,index,value")
for rate in (250, 256, 500, 512, 1000, 1024):
    phases = 128 // gcd(rate, 128)
    taps = phases * 4 * ceil(rate / 8 / 4)
    response = signal.firwin(taps, 62, window=("kaiser", 5), fs=rate * phases)
    for index in range(0, taps, 29):
        print(f"{rate},{phases},{taps},{index},{response[index]:.17e}")
