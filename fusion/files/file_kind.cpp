#include "fusion/files/file_kind.hpp"

#include <array>
#include <cstddef>

namespace spectra::files {

namespace {

struct Kind {
  std::string_view beginning;
  std::string_view name;
};

using namespace std::string_view_literals;

constexpr std::array<Kind, 27> kKinds = {{
    {"PK\x03\x04"sv, "a ZIP archive: unpack it first"sv},
    {"\x1f\x8b"sv, "gzip data: unpack it first"sv},
    {"BZh"sv, "bzip2 data: unpack it first"sv},
    {"\xfd"
     "7zXZ"sv,
     "xz data: unpack it first"sv},
    {"\x28\xb5\x2f\xfd"sv, "Zstandard data: unpack it first"sv},
    {"7z\xbc\xaf"sv, "a 7-Zip archive: unpack it first"sv},
    {"Rar!"sv, "a RAR archive: unpack it first"sv},
    {"\xff\xfe"sv, "text in UTF-16: save it as ASCII or UTF-8"sv},
    {"\xfe\xff"sv, "text in UTF-16: save it as ASCII or UTF-8"sv},
    {"glTF"sv, "a GLB file: convert it to PLY"sv},
    {"DRACO"sv, "a Draco file: convert it to PLY"sv},
    {"LASF"sv, "a LAS file: convert it to PLY"sv},
    {"ASTM-E57"sv, "an E57 file: convert it to PLY"sv},
    {"# .PCD"sv, "a PCD file: convert it to PLY"sv},
    {"VERSION ."sv, "a PCD file: convert it to PLY"sv},
    {"solid"sv, "an STL file: convert it to PLY"sv},
    {"OFF"sv, "an OFF file: convert it to PLY"sv},
    {"COFF"sv, "an OFF file: convert it to PLY"sv},
    {"mtllib"sv, "an OBJ file: convert it to PLY"sv},
    {"v "sv, "an OBJ file: convert it to PLY"sv},
    {"{"sv, "JSON: convert it to PLY"sv},
    {"<"sv, "XML or HTML: convert it to PLY"sv},
    {"\xff\xd8\xff"sv, "a JPEG picture: the scene is wanted, a mesh or cloud as PLY"sv},
    {"\x89PNG"sv, "a PNG picture: the scene is wanted, a mesh or cloud as PLY"sv},
    {"II*\0"sv, "a TIFF picture: the scene is wanted, a mesh or cloud as PLY"sv},
    {"MM\0*"sv, "a TIFF picture: the scene is wanted, a mesh or cloud as PLY"sv},
    {"version https://git-lfs"sv, "a Git LFS pointer: fetch the file itself (git lfs pull)"sv},
}};

}  // namespace

std::string_view file_kind(std::string_view first_bytes) {
  constexpr std::size_t kTarMark = 257;
  if (first_bytes.size() > kTarMark && first_bytes.substr(kTarMark).starts_with("ustar")) {
    return "a tar archive: unpack it first";
  }
  for (const Kind& kind : kKinds) {
    if (first_bytes.starts_with(kind.beginning)) return kind.name;
  }
  return {};
}

}  // namespace spectra::files
