#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/colour/palette.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/files/read_options.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/settings.hpp"

namespace spectra::files {

/// What was fused, and with what.
struct FusedFile {
  fusion::FusionPlan plan;
  fusion::TemperatureSummary temperature;
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  std::vector<Note> notes;  ///< As read_ply() has them.
};

/// Writes the PLY file `in`, fused, to `out` (which appears whole or not at all, and may be the same file) without ever
/// holding it: one pass for the statistics, one more for a method that asks for a histogram, one to fuse and write. Memory
/// is constant but for one bit a vertex, or 12 bytes where faces have more than three corners. The bytes are those of read_ply(), FusionPlan::fuse() and write_ply(). Errors are
/// theirs too; safe on untrusted input. The progress of `options` is told of kReadingPhase, kHistogramPhase and kFusingPhase.
base::Result<FusedFile> fuse_ply(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const fusion::FusionSettings& settings, const ReadOptions& options = {});

/// The same with a palette table of the caller's.
base::Result<FusedFile> fuse_ply(const std::filesystem::path& in, const std::filesystem::path& out,
                                 const fusion::FusionSettings& settings, const fusion::PaletteTable& palette,
                                 const ReadOptions& options = {});

}  // namespace spectra::files
