#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace spectra::test {

/// The bytes of a file in the making.
class PlyBytes {
 public:
  PlyBytes& text(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  /// Little-endian.
  template <class T>
  PlyBytes& le(T value) {
    return put(value, std::endian::native == std::endian::big);
  }
  /// Big-endian.
  template <class T>
  PlyBytes& be(T value) {
    return put(value, std::endian::native == std::endian::little);
  }
  template <class T>
  PlyBytes& ordered(bool big_endian, T value) {
    return big_endian ? be(value) : le(value);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  template <class T>
  PlyBytes& put(T value, bool reversed) {
    auto bytes = std::bit_cast<std::array<char, sizeof(T)>>(value);
    if (reversed) std::reverse(bytes.begin(), bytes.end());
    bytes_.append(bytes.data(), bytes.size());
    return *this;
  }
  std::string bytes_;
};

/// A folder of its own for a test's files, removed with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "spectra-test-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::filesystem::filesystem_error("mkdtemp", pattern, {});
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    const auto path = path_ / name;
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
  }

 private:
  std::filesystem::path path_;
};

inline std::string file_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace spectra::test
