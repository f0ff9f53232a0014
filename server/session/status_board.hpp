#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "fusion/files/ply_reader.hpp"
#include "protocol/messages/stream_messages.hpp"

namespace spectra::session {

/// What one viewer was told of the state of things, so that he is told again only what is otherwise now. For one thread.
class StatusBoard {
 public:
  using Tell = std::function<void(const protocol::Status& status)>;
  /// `tell` is called from within the functions below.
  explicit StatusBoard(Tell tell) : tell_(std::move(tell)) {}

  /// No message takes the status back.
  void set(const std::string& id, protocol::StatusLevel level, std::optional<std::string> message);

  /// What was noticed while the scene was read, each as "scene." and the note's id; takes back what was said of the one before.
  void set_notes(std::span<const files::Note> notes);

 private:
  const Tell tell_;
  std::map<std::string, std::string> told_;
};

}  // namespace spectra::session
