#pragma once

#include <hwy/targets.h>

#include <cstdint>
#include <string>
#include <vector>

namespace spectra::fusion::test {

/// Every instruction set that is compiled in and that this machine has, the best first.
inline const std::vector<std::int64_t>& instruction_sets() {
  static const std::vector<std::int64_t> list = [] {
    std::vector<std::int64_t> targets;
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) targets.push_back(target);
    return targets;
  }();
  return list;
}

/// Lets the kernels run on one instruction set while it lives. Not for several threads at once.
class UsingInstructionSet {
 public:
  explicit UsingInstructionSet(std::int64_t target) { set(target); }
  ~UsingInstructionSet() { set(0); }
  UsingInstructionSet(const UsingInstructionSet&) = delete;
  UsingInstructionSet& operator=(const UsingInstructionSet&) = delete;

 private:
  static void set(std::int64_t target) {
    static_cast<void>(instruction_sets());
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

inline std::string name_of(std::int64_t target) {
  return hwy::TargetName(target);
}

}  // namespace spectra::fusion::test
