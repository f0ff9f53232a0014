#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "protocol/frame_message.hpp"
#include "server/mapping/picture_file.hpp"

namespace {

template <class Picture>
void check(const spectra::base::Result<Picture>& picture) {
  if (!picture) {
    if (picture.error().message.empty()) std::abort();
    return;
  }
  const auto& read = picture.value();
  if (read.width <= 0 || read.height <= 0) std::abort();
  if (read.pixels.size() != static_cast<std::size_t>(read.width) * static_cast<std::size_t>(read.height)) std::abort();
}

}  // namespace

/// Any bytes as a message of /frames: a head that is accepted says the same when it is written and read again; what follows it is
/// read as a picture of either kind.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace spectra;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  std::span<const unsigned char> body(data, size);
  if (const auto message = protocol::decoded_frame_message(text)) {
    const auto& [head, body_begin] = message.value();
    if (body_begin > size) std::abort();
    body = body.subspan(body_begin);
    const auto again = protocol::decoded_frame_message(protocol::encoded_frame_message(head, text.substr(body_begin)));
    if (!again || protocol::to_json(again.value().head) != protocol::to_json(head)) std::abort();
  } else if (message.error().message.empty()) {
    std::abort();
  }
  check(mapping::png16_of(body, "a picture"));
  check(mapping::colour_of(body, "a picture"));
  return 0;
}
