#include "server/app/unit_sender.hpp"

#include <cstdlib>
#include <fstream>
#include <utility>
#include <vector>

#include "server/app/command_output.hpp"
#include "server/mapping/map_ply.hpp"
#include "server/net/request_target.hpp"
#include "server/sources/unit_hand_over.hpp"

namespace spectra::app {
namespace {

constexpr std::chrono::milliseconds kSendEvery{500};

}  // namespace

std::variant<UnitSender, std::string> UnitSender::to(const std::string& url,
                                                     const std::optional<std::filesystem::path>& token_file) {
  auto address = net::parsed_ingest_address(url);
  if (const auto* wrong = std::get_if<std::string>(&address)) return "--to " + *wrong;
  std::string token;
  if (token_file) {
    std::ifstream file(*token_file);
    if (!(file >> token)) return token_file->string() + ": there is no token in its first line";
  } else if (const char* text = std::getenv("SPECTRA_TOKEN")) {
    token = text;
  }
  return UnitSender(std::get<net::IngestAddress>(std::move(address)), std::move(token));
}

std::optional<std::string> UnitSender::send_changes(mapping::Mapper& mapper, const mapping::PoseAnswer& eye,
                                                    bool is_last, jobs::WorkerPool& pool) {
  if (eye.state == mapping::PoseState::Known) eye_ = eye.pose.translation();
  const auto now = std::chrono::steady_clock::now();
  if (!is_last && now - last_ < kSendEvery) return std::nullopt;
  last_ = now;
  const std::vector<mapping::PublishedUnit> units = mapper.changed_units(publisher_, eye_, pool);
  if (units.empty()) return std::nullopt;
  const double begin_unix_s = mapping::unix_begin_s(mapper.begin_s(), mapper.newest_s(), sources::unix_now_s());
  net::BlocksToSend blocks;
  blocks.count = units.size();
  blocks.read = [&](std::size_t index, std::uint64_t max_block_bytes) -> std::optional<net::OutgoingBlock> {
    const mapping::PublishedUnit& unit = units[index];
    if (unit.mesh.triangles.empty()) return net::OutgoingBlock{net::target_text(unit.id, {}), ""};
    auto ply = mapping::block_ply(unit.mesh, begin_unix_s);
    if (ply && ply.value().size() <= max_block_bytes) {
      return net::OutgoingBlock{net::target_text(unit.id, sources::unit_query("", eye_)), std::move(ply).value()};
    }
    ++refused_count_;
    warn(unit.id + (ply ? " is larger than the server takes; map with larger voxels" : ": " + ply.error().message));
    return std::nullopt;
  };
  blocks.acknowledged = [&](std::size_t index, const auto&) {
    ++sent_count_;
    if (!known_.insert(units[index].id).second) ++again_count_;
  };
  blocks.refused = [&](std::size_t index, const auto& answer) {
    ++refused_count_;
    warn(units[index].id + " is refused: " + answer.reason);
  };
  blocks.broken = [](const std::string& why) { warn(why + "; connecting again"); };
  net::SendingLimits limits;
  limits.token = token_;
  return net::send_blocks(address_, blocks, limits);
}

}  // namespace spectra::app
