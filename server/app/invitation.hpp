#pragma once

#include <string>

namespace spectra::app {

/// A text as a QR code for a terminal: two rows of modules a line, dark on light with a quiet margin, whatever the terminal's colours.
std::string qr_text(const std::string& text);

}  // namespace spectra::app
