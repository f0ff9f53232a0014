#include "server/session/status_board.hpp"

#include <set>
#include <utility>
#include <vector>

namespace spectra::session {
namespace {

/// The statuses that are notes on the scene: this and the note's id.
const std::string kNotePrefix = "scene.";

}  // namespace

void StatusBoard::set(const std::string& id, protocol::StatusLevel level, std::optional<std::string> message) {
  const auto told = told_.find(id);
  if (!message) {
    if (told == told_.end()) return;
    told_.erase(told);
  } else {
    if (told != told_.end() && told->second == *message) return;
    told_.insert_or_assign(id, *message);
  }
  tell_(protocol::Status{id, level, std::move(message)});
}

void StatusBoard::set_notes(std::span<const files::Note> notes) {
  std::set<std::string> held;
  for (const files::Note& note : notes) {
    const std::string id = kNotePrefix + note.id;
    set(id, note.needs_attention ? protocol::StatusLevel::Warning : protocol::StatusLevel::Info, note.message);
    held.insert(id);
  }
  std::vector<std::string> outdated;
  for (const auto& [id, message] : told_) {
    if (id.starts_with(kNotePrefix) && !held.contains(id)) outdated.push_back(id);
  }
  for (const auto& id : outdated) set(id, protocol::StatusLevel::Info, std::nullopt);
}

}  // namespace spectra::session
