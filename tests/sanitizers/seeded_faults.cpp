// seeded_faults FAULT: commits it; see CMakeLists.txt.
#include <cstdio>
#include <limits>
#include <memory>
#include <string_view>
#include <thread>

namespace {

int use_after_free() {
  auto value = std::make_unique<int>(1);
  const volatile int* const gone = value.get();
  value.reset();
  return *gone;
}

int overflow(int by) {
  volatile int most = std::numeric_limits<int>::max();
  return most + by;
}

/// As counted in two threads without an order.
int race() {
  int count = 0;
  std::thread other([&count] { ++count; });
  ++count;
  other.join();
  return count;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view fault = argc > 1 ? argv[1] : "";
  int result = 0;
  if (fault == "use_after_free") result = use_after_free();
  if (fault == "overflow") result = overflow(argc);
  if (fault == "race") result = race();
  std::printf("%d: nobody has seen it\n", result);
  return 0;
}
