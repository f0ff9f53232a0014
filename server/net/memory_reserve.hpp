#pragma once

#include <cstddef>

namespace spectra::net {

/// From now on, where `new` finds no memory, a part of a reserve goes back to the system, so that what was begun can be taken apart:
/// destructors may want memory, too (that of nlohmann::json does), and end the program where there is none. `new` tries again as long
/// as half of the reserve is left, and on the way of an exception as long as any is; std::bad_alloc is thrown after that. The
/// reserve is address space without pages. To be called once, before there are threads.
void keep_memory_reserve();

/// Takes again what was given back. False as long as there is no memory for it: then nothing new is to be begun. True where no reserve
/// is kept. To be called again and again, for who holds memory already takes of the reserve, too. Thread-safe.
bool refill_memory_reserve();

/// What of it is there to be given back. Thread-safe.
std::size_t memory_reserve_bytes();

}  // namespace spectra::net
