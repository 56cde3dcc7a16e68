"""Prints tests/scipy_response.csv: python3 tests/scipy_response.py > tests/scipy_response.csv"""
import numpy as np
import scipy
from scipy import signal

print(f"# scipy {scipy.__version__}: iirnotch(mains, 30, fs) then butter(5, [0.5, 60], 'bandpass', fs=fs, output='sos')")
print("# rate_hz,mains_hz,frequency_hz,re,im")
for rate in (250, 256, 500, 512, 1000, 1024):
    for mains in (50, 60):
        b, a = signal.iirnotch(mains, 30, fs=rate)
        sos = signal.butter(5, [0.5, 60], "bandpass", fs=rate, output="sos")
        frequencies = np.array([0.1, 0.4, 0.5, 1, 4, 10, 20, 30, 45, 49, 51, 59.5, 60.5, 70, 100, 120])
        response = signal.freqz(b, a, frequencies, fs=rate)[1] * signal.sosfreqz(sos, frequencies, fs=rate)[1]
        for f, h in zip(frequencies, response):
            print(f"{rate},{mains},{f},{h.real:.15e},{h.imag:.15e}")
