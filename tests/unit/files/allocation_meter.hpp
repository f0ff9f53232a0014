#pragma once

#include <cstddef>

namespace spectra::test {

/// How much more memory than at its construction was ever allocated with operator new at once, by any thread. Deterministic,
/// where the resident size of the process is not.
class AllocationMeter {
 public:
  AllocationMeter();
  std::size_t peak_bytes() const;

 private:
  std::size_t bytes_before_;
};

}  // namespace spectra::test
