#pragma once

#include <string>
#include <string_view>

namespace spectra::session {

/// Makes the ids of the sessions of one run of the server, and knows them again. Tile revisions mean something only within
/// the run that issued them, so whoever comes back with tiles says from which session they are. To clients the ids are
/// opaque; they give no rights. Thread-safe.
class SessionIds {
 public:
  SessionIds();

  /// 32 hexadecimal digits that no session had before.
  std::string next() const;

  /// Safe on untrusted input.
  bool is_of_this_run(std::string_view session_id) const;

 private:
  const std::string run_;  ///< What every id of this run begins with.
};

}  // namespace spectra::session
