//! EEG recordings (EDF, BDF, GDF) played through a virtual ADC.
#![forbid(unsafe_code)]
