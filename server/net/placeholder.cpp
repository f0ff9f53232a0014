namespace spectra {}
