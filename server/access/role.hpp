#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace spectra::access {

/// Who somebody is, by the token that he showed.
enum class AccessRole { Viewer, Operator, Ingest, Admin };

/// What is asked for.
enum class Right {
  Nothing,     ///< Anybody may.
  Watch,       ///< The picture, and settings of one's own picture.
  Operate,     ///< What all share, measured values as data (raw layers, exports), and what the server counts.
  ReadBlocks,  ///< Blocks of the map, as data.
  ChangeMap,   ///< Put and take out blocks.
  Administer,  ///< Let others in.
};

/// The matrix of docs/access.md.
inline bool may(AccessRole role, Right right) {
  switch (role) {
    case AccessRole::Admin:
      return true;
    case AccessRole::Operator:
      return right == Right::Nothing || right == Right::Watch || right == Right::Operate || right == Right::ReadBlocks;
    case AccessRole::Ingest:
      return right == Right::Nothing || right == Right::ReadBlocks || right == Right::ChangeMap;
    case AccessRole::Viewer:
      break;
  }
  return right == Right::Nothing || right == Right::Watch;
}

inline constexpr std::array kRoles{AccessRole::Viewer, AccessRole::Operator, AccessRole::Ingest, AccessRole::Admin};

inline std::string_view to_string(AccessRole role) {
  switch (role) {
    case AccessRole::Viewer:
      return "viewer";
    case AccessRole::Operator:
      return "operator";
    case AccessRole::Ingest:
      return "ingest";
    case AccessRole::Admin:
      break;
  }
  return "admin";
}

inline std::optional<AccessRole> access_role(std::string_view name) {
  for (const AccessRole role : kRoles) {
    if (name == to_string(role)) return role;
  }
  return std::nullopt;
}

}  // namespace spectra::access
