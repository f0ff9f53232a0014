#pragma once

#include "server/mapping/frame_folder.hpp"

namespace spectra::app {

/// Writes what was wrong with frames to standard error, one line each.
void print_faults(const mapping::FaultLog& faults);

}  // namespace spectra::app
