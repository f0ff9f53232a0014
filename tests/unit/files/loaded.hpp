#pragma once

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "fusion/files/ply_reader.hpp"
#include "ply_bytes.hpp"

namespace spectra::test {

/// Reads a scene from bytes, through a file in memory.
inline base::Result<files::LoadedScene> read_bytes(std::string_view bytes, const files::ReadOptions& options = {}) {
  const int descriptor = ::memfd_create("scene.ply", MFD_CLOEXEC);
  if (descriptor < 0 || ::write(descriptor, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) {
    ADD_FAILURE() << "no file in memory";
  }
  auto scene = files::read_ply("/proc/self/fd/" + std::to_string(descriptor), options);
  ::close(descriptor);
  return scene;
}

/// The same where an error is a failed test.
inline files::LoadedScene loaded(std::string_view bytes, const files::ReadOptions& options = {}) {
  auto scene = read_bytes(bytes, options);
  if (!scene) {
    ADD_FAILURE() << scene.error().message;
    return {};
  }
  return std::move(scene).value();
}

/// The count of a note, 0 when there is none.
inline std::uint64_t note_count(const files::LoadedScene& scene, std::string_view id) {
  const auto note = std::find_if(scene.notes.begin(), scene.notes.end(),
                                 [id](const files::Note& candidate) { return candidate.id == id; });
  return note == scene.notes.end() ? 0 : note->count;
}

inline std::string note_text(const files::LoadedScene& scene, std::string_view id) {
  const auto note = std::find_if(scene.notes.begin(), scene.notes.end(),
                                 [id](const files::Note& candidate) { return candidate.id == id; });
  return note == scene.notes.end() ? std::string() : note->message;
}

inline constexpr std::string_view kXyz = "property float x\nproperty float y\nproperty float z\n";
inline constexpr std::string_view kRgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
inline constexpr std::string_view kFaces = "property list uchar int vertex_indices\n";

}  // namespace spectra::test
