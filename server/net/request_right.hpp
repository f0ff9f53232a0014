#pragma once

#include <cstdint>
#include <string_view>

#include "server/access/role.hpp"
#include "server/net/http_types.hpp"

namespace spectra::net {

inline constexpr std::string_view kSessionPath = "/api/v1/session";
inline constexpr std::string_view kCodesPath = "/api/v1/session/codes";

/// Close code of a session whose token is there no more.
inline constexpr std::uint16_t kAccessWithdrawn = 4003;

/// What somebody must have the right to who asks for a path.
inline access::Right right_of(std::string_view path, bool is_change) {
  struct Row {
    std::string_view begin;
    access::Right right;
    bool is_whole = true;
  };
  // The first that fits.
  constexpr Row kRows[] = {
      {"/ws", access::Right::Watch},
      {"/ingest", access::Right::ChangeMap},
      {"/frames", access::Right::ChangeMap},
      {"/metrics", access::Right::Operate},
      {kCodesPath, access::Right::Operate},
      {kSessionPath, access::Right::Nothing},
      {kBlocksPath, access::Right::ReadBlocks, false},
      {"/api/v1/scene.", access::Right::Operate, false},
      {"/api/", access::Right::Watch, false},
  };
  for (const Row& row : kRows) {
    if (row.is_whole ? path != row.begin : !path.starts_with(row.begin)) continue;
    return row.right == access::Right::ReadBlocks && is_change ? access::Right::ChangeMap : row.right;
  }
  return access::Right::Nothing;  // the client, /healthz, /readyz
}

}  // namespace spectra::net
