#include "protocol/frame_message.hpp"

#include <array>
#include <nlohmann/json.hpp>
#include <span>

#include "protocol/jsonrpc.hpp"
#include "protocol/little_endian.hpp"

namespace spectra::protocol {

Result<FrameMessage> decoded_frame_message(std::string_view message) {
  const auto malformed = [](std::string what) {
    return refusal(RpcErrorCode::InvalidRequest, "frame message: " + what, "head");
  };
  if (!message.starts_with(kFrameMagic)) return malformed("does not begin with \"SPF1\"");
  if (message.size() < kFrameLeadSize) return malformed("ends before its head");
  LittleEndianReader in(std::as_bytes(std::span(message.data() + kFrameMagic.size(), sizeof(std::uint32_t))));
  const auto head_bytes = in.get<std::uint32_t>();
  if (head_bytes > kFrameHeadSize) return malformed("its head is larger than 65536 bytes");
  if (message.size() - kFrameLeadSize < head_bytes) return malformed("ends within its head");
  JsonLimits limits;
  limits.max_size_bytes = kFrameHeadSize;
  auto json = parsed_json(message.substr(kFrameLeadSize, head_bytes), limits);
  if (!json) return malformed(json.error().message);
  BOOST_OUTCOME_TRY(FrameHead head, from_json<FrameHead>(json.value()));
  return FrameMessage{std::move(head), kFrameLeadSize + head_bytes};
}

std::string encoded_frame_message(const FrameHead& head, std::string_view body) {
  const std::string text = to_json(head).dump();
  std::array<std::byte, sizeof(std::uint32_t)> size{};
  LittleEndianWriter out(size);
  out.put(static_cast<std::uint32_t>(text.size()));
  std::string message(kFrameMagic);
  for (const std::byte byte : size) message += static_cast<char>(byte);
  message += text;
  message += body;
  return message;
}

}  // namespace spectra::protocol
