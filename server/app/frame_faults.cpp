#include "server/app/frame_faults.hpp"

#include <spdlog/fmt/fmt.h>

#include "server/app/command_output.hpp"

namespace spectra::app {

void print_faults(const mapping::FaultLog& faults) {
  for (const mapping::FrameFault& fault : faults.all()) {
    if (fault.count > 0) warn(fault.what + (fault.count > 1 ? fmt::format(" ({} times)", fault.count) : ""));
  }
}

}  // namespace spectra::app
