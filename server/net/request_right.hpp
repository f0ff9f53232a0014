#pragma once

#include <cstdint>
#include <string_view>

#include "server/access/role.hpp"
#include "server/net/http_types.hpp"

namespace spectra::server {

inline constexpr std::string_view kSessionPath = "/api/v1/session";
inline constexpr std::string_view kCodesPath = "/api/v1/session/codes";

/// Close code of a session whose token is there no more.
inline constexpr std::uint16_t kAccessWithdrawn = 4003;

/// What somebody must have the right to who asks for a path.
inline Right right_of(std::string_view path, bool is_change) {
  struct Row {
    std::string_view begin;
    Right right;
    bool is_whole = true;
  };
  // The first that fits.
  constexpr Row kRows[] = {
      {"/ws", Right::Watch},
      {"/ingest", Right::ChangeMap},
      {"/metrics", Right::Operate},
      {kCodesPath, Right::Operate},
      {kSessionPath, Right::Nothing},
      {kBlocksPath, Right::ReadBlocks, false},
      {"/api/v1/scene.", Right::Operate, false},
      {"/api/", Right::Watch, false},
  };
  for (const Row& row : kRows) {
    if (row.is_whole ? path != row.begin : !path.starts_with(row.begin)) continue;
    return row.right == Right::ReadBlocks && is_change ? Right::ChangeMap : row.right;
  }
  return Right::Nothing;  // the client, /healthz, /readyz
}

}  // namespace spectra::server
