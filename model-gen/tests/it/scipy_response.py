"""Prints tests/it/scipy_response.csv: python3 tests/it/scipy_response.py > tests/it/scipy_response.csv"""
import numpy as np
import scipy
from scipy import signal

print(f"# scipy {scipy.__version__}: iirnotch(k * mains, 30, fs) for k = 1 .. 1 + harmonics, then butter(5, [0.5, 60], 'bandpass', fs=fs, output='sos')")
print("# rate_hz,mains_hz,harmonics,frequency_hz,re,im")
for rate in (250, 256, 500, 512, 1000, 1024):
    for mains in (50, 60):
        for harmonics in (0, 1, 2):
            if (harmonics + 1) * mains >= rate / 2:
                continue
            sos = signal.butter(5, [0.5, 60], "bandpass", fs=rate, output="sos")
            frequencies = np.array([0.1, 0.4, 0.5, 1, 4, 10, 20, 30, 45, 49, 51, 59.5, 60.5, 70, 99, 100, 120])
            response = signal.sosfreqz(sos, frequencies, fs=rate)[1]
            for k in range(1, harmonics + 2):
                response = response * signal.freqz(*signal.iirnotch(k * mains, 30, fs=rate), frequencies, fs=rate)[1]
            for f, h in zip(frequencies, response):
                print(f"{rate},{mains},{harmonics},{f},{h.real:.15e},{h.imag:.15e}")
