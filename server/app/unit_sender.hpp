#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <variant>

#include "server/mapping/mapper.hpp"
#include "server/net/ingest_client.hpp"

namespace spectra::app {

/// Sends the units of a growing map to a server, as blocks of its map. For one thread.
class UnitSender {
 public:
  /// An address and a token as of `spectra push`; a sentence when they cannot be meant.
  static std::variant<UnitSender, std::string> to(const std::string& url,
                                                  const std::optional<std::filesystem::path>& token_file);

  /// Sends what has changed and waits until all is answered, at most twice a second unless `is_last`. A sentence when the server is not
  /// there, or did not come back; nothing otherwise. What it refuses is said as a warning.
  std::optional<std::string> send_changes(mapping::Mapper& mapper, const mapping::PoseAnswer& eye, bool is_last,
                                          jobs::WorkerPool& pool);

  std::size_t sent_count() const { return sent_count_; }    ///< Acknowledged.
  std::size_t again_count() const { return again_count_; }  ///< Of these, units that the server had already.
  std::size_t refused_count() const { return refused_count_; }

 private:
  UnitSender(net::IngestAddress address, std::string token) : address_(std::move(address)), token_(std::move(token)) {}

  net::IngestAddress address_;
  std::string token_;
  mapping::UnitPublisher publisher_;
  std::set<std::string> known_;
  std::chrono::steady_clock::time_point last_{};
  Eigen::Vector3d eye_ = Eigen::Vector3d::Zero();
  std::size_t sent_count_ = 0, again_count_ = 0, refused_count_ = 0;
};

}  // namespace spectra::app
