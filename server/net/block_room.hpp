#pragma once

#include <cstddef>

#include "server/net/server_context.hpp"

namespace spectra::net {

/// Room for the body of a block, as long as it is in memory here.
class BlockRoom {
 public:
  BlockRoom(ServerContext& context, std::size_t size_bytes)
      : context_(context),
        size_bytes_(size_bytes),
        is_there_(context.block_bytes.fetch_add(size_bytes) + size_bytes <=
                  context.options.limits.block_bytes_at_once) {
    if (!is_there_) context_.block_bytes -= size_bytes_;
  }
  ~BlockRoom() {
    if (is_there_) context_.block_bytes -= size_bytes_;
  }
  BlockRoom(const BlockRoom&) = delete;
  BlockRoom& operator=(const BlockRoom&) = delete;

  bool is_there() const { return is_there_; }

 private:
  ServerContext& context_;
  const std::size_t size_bytes_;
  const bool is_there_;
};

}  // namespace spectra::net
