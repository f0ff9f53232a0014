#include "server/net/memory_reserve.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <exception>
#include <new>

namespace spectra::net {
namespace {

/// One for each thing that fails before the reserve is filled again; all values of a parsed message fit into it.
constexpr std::size_t kPartBytes = 512U << 10U;
constexpr std::size_t kPartCount = 16;

// A new_handler has no state of its own.
std::array<std::atomic<void*>, kPartCount> parts{};  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)
std::atomic<bool> is_kept{false};                    // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

void give_part_back() {
  for (auto& part : parts) {
    if (void* const memory = part.exchange(nullptr)) {
      ::munmap(memory, kPartBytes);
      // A destructor must not throw: the program would end. Whoever may be in one tries again: all of them while there is plenty, and on
      // the way of an exception to the end.
      if (std::uncaught_exceptions() > 0 || memory_reserve_bytes() >= kPartBytes * kPartCount / 2) return;
      break;
    }
  }
  throw std::bad_alloc();
}

}  // namespace

void keep_memory_reserve() {
  is_kept = true;
  refill_memory_reserve();
  std::set_new_handler(give_part_back);
}

bool refill_memory_reserve() {
  if (!is_kept) return true;
  for (auto& part : parts) {
    if (part != nullptr) continue;
    void* const memory = ::mmap(nullptr, kPartBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) return false;
    void* none = nullptr;
    if (!part.compare_exchange_strong(none, memory)) ::munmap(memory, kPartBytes);
  }
  return true;
}

std::size_t memory_reserve_bytes() {
  const auto kept = std::count_if(parts.begin(), parts.end(), [](const auto& part) { return part != nullptr; });
  return static_cast<std::size_t>(kept) * kPartBytes;
}

}  // namespace spectra::net
