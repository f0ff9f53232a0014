// Files that a broken program or an attacker may send: an error that says what and where, no crash (the sanitizer build
// runs this too), no long wait (the tests have a time limit), and no memory beyond a small multiple of the file.
#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "allocation_meter.hpp"
#include "fusion/files/ply_reader.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::PlyBytes;

struct HostileFile {
  std::string name;
  std::string bytes;
  std::optional<base::ErrorCode> code;  ///< nullopt: reads well.
  std::string says;
};

const std::string kXyzText(test::kXyz);
const std::string kFaceText(test::kFaces);

std::string head(const std::string& format, const std::string& rest) {
  return "ply\nformat " + format + " 1.0\n" + rest + "end_header\n";
}

std::string vertices(const std::string& count) {
  return "element vertex " + count + "\n" + kXyzText;
}

std::string binary_head(const std::string& rest) {
  return head("binary_little_endian", rest);
}

std::string three_vertices() {
  PlyBytes body;
  for (const float value : {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}) body.le(value);
  return body.bytes();
}

/// Three vertices and a face list of that declaration and those bytes.
std::string face_file(const std::string& count, const std::string& list, const std::string& face_bytes) {
  return binary_head(vertices("3") + "element face " + count + "\nproperty list " + list + " vertex_indices\n") +
         three_vertices() + face_bytes;
}

std::string ascii_faces(const std::string& count, const std::string& lines) {
  return head("ascii", vertices("3") + "element face " + count + "\n" + kFaceText) + "0 0 0\n1 0 0\n0 1 0\n" + lines;
}

std::string binary_position(float x) {
  return binary_head(vertices("2")) + PlyBytes().le(0.0F).le(0.0F).le(0.0F).le(1.0F).le(x).le(0.0F).bytes();
}

std::vector<HostileFile> hostile_files() {
  using Code = base::ErrorCode;
  const std::string many_bytes(100'000, '\xff');
  const std::string zeros(100'000, '\0');
  std::vector<HostileFile> files = {
      {"empty", "", Code::BadHeader, "empty"},
      {"one byte", "p", Code::BadHeader, "not a PLY"},
      {"magic alone", "ply", Code::BadHeader, "not a PLY"},
      {"binary rubbish", many_bytes, Code::BadHeader, "not a PLY"},
      {"zeros", zeros, Code::BadHeader, "not a PLY"},
      {"no end_header", "ply\nformat ascii 1.0\nelement vertex 1\n", Code::BadHeader, "before end_header"},
      {"header for ever", "ply\nformat ascii 1.0\n" + std::string(1'000'000, '\n'), Code::BadHeader, "end_header"},
      {"header line for ever", "ply\ncomment " + std::string(1'000'000, 'x'), Code::BadHeader, "end_header"},
      {"property first", "ply\nformat ascii 1.0\nproperty float x\nelement vertex 1\nend_header\n0\n", Code::BadHeader,
       "before any element"},
      {"no vertex element", head("ascii", "element face 0\n" + kFaceText), Code::BadHeader, "no element 'vertex'"},
      {"no x", head("ascii", "element vertex 1\nproperty float y\nproperty float z\n") + "0 0\n", Code::BadHeader,
       "no property 'x'"},
      {"x is a list",
       head("ascii",
            "element vertex 1\nproperty list uchar float x\nproperty float y\n"
            "property float z\n") +
           "1 0 0 0\n",
       Code::BadHeader, "no property 'x'"},
      {"integer positions",
       head("ascii", "element vertex 1\nproperty int x\nproperty int y\nproperty int z\n") + "0 0 0\n", std::nullopt,
       ""},
      {"zero vertices", head("ascii", vertices("0")), Code::BadValue, "empty"},
      {"four billion vertices", binary_head(vertices("4000000000")) + three_vertices(), Code::Truncated, "4000000000"},
      {"2^64 - 1 vertices", binary_head(vertices("18446744073709551615")) + three_vertices(), Code::Truncated,
       "18446744073709551615"},
      {"2^64 vertices", binary_head(vertices("18446744073709551616")), Code::BadHeader, "2^64"},
      {"negative vertices", binary_head(vertices("-5")), Code::BadHeader, "'-5'"},
      {"count with a fraction", binary_head(vertices("3.5")), Code::BadHeader, "'3.5'"},
      {"product of count and size overflows",
       binary_head("element a 2305843009213693952\nproperty double d\n" + vertices("1")) + three_vertices(),
       Code::Truncated, "'a'"},
      {"sum of elements overflows",
       binary_head("element a 9223372036854775807\nproperty char c\nelement b 9223372036854775807\nproperty char c\n" +
                   vertices("1")),
       Code::Truncated, "'a'"},
      {"countless entries of nothing",
       binary_head("element nothing 18446744073709551615\n" + vertices("3")) + three_vertices(), std::nullopt, ""},
      {"countless entries of nothing in ascii",
       head("ascii", "element nothing 18446744073709551615\n" + vertices("1")) + "0 0 0\n", std::nullopt, ""},
      {"four billion faces", face_file("4000000000", "uchar int", "\x03"), Code::Truncated, "4000000000"},
      {"body cut in a vertex", binary_head(vertices("3")) + three_vertices().substr(0, 30), Code::Truncated,
       "30 bytes"},
      {"body cut in a face", face_file("1", "uchar int", PlyBytes().le(std::uint8_t{3}).le(0U).le(1U).bytes()),
       Code::Truncated, "face 0"},
      {"second face missing its end",
       face_file("2", "uchar int", PlyBytes().le(std::uint8_t{3}).le(0U).le(1U).le(2U).text("\x03").bytes()),
       Code::Truncated, "face 1"},
      {"no body", binary_head(vertices("3")), Code::Truncated, "0 bytes"},
      {"list of -1", face_file("1", "char int", "\xff\xff\xff\xff\xff"), Code::BadValue, "-1"},
      {"list of 2^31 - 1", face_file("1", "int int", PlyBytes().le(std::int32_t{2'147'483'647}).text(zeros).bytes()),
       Code::Truncated, "2147483647"},
      {"list of 2^32 - 1", face_file("1", "uint double", PlyBytes().le(~0U).text(zeros).bytes()), Code::BadHeader,
       "double"},
      {"skipped list of 2^32 - 1",
       binary_head("element junk 1\nproperty list uint double d\n" + vertices("1")) +
           PlyBytes().le(~0U).text(zeros).bytes(),
       Code::Truncated, "junk 0"},
      {"index past the end", face_file("1", "uchar int", PlyBytes().le(std::uint8_t{3}).le(0U).le(1U).le(3U).bytes()),
       Code::BadValue, "face 0 refers to vertex 3"},
      {"negative index",
       face_file("1", "uchar int", PlyBytes().le(std::uint8_t{3}).le(0U).le(1U).le(std::int32_t{-1}).bytes()),
       Code::BadValue, "vertex -1"},
      {"index of 2^32 - 1", face_file("1", "uchar uint", PlyBytes().le(std::uint8_t{3}).le(0U).le(1U).le(~0U).bytes()),
       Code::BadValue, "vertex 4294967295"},
      {"bad index deep in a polygon",
       face_file("1", "uchar uchar", PlyBytes().text(std::string("\x05\x00\x01\x02\x00\x09", 6)).bytes()),
       Code::BadValue, "vertex 9"},
      {"one polygon of the whole file", face_file("1", "uint uchar", PlyBytes().le(100'000U).text(zeros).bytes()),
       std::nullopt, ""},
      {"polygon of all in turn",
       face_file("1", "uint uchar",
                 [] {
                   PlyBytes bytes;
                   bytes.le(60'000U);
                   for (int i = 0; i < 20'000; ++i) bytes.text(std::string("\x00\x01\x02", 3));
                   return bytes.bytes();
                 }()),
       std::nullopt, ""},
      {"countless empty faces", face_file("100000", "uchar int", zeros), std::nullopt, ""},
      {"NaN position", binary_position(std::numeric_limits<float>::quiet_NaN()), std::nullopt, ""},
      {"infinite position", binary_position(std::numeric_limits<float>::infinity()), std::nullopt, ""},
      {"position beyond float",
       head("ascii", "element vertex 1\nproperty double x\nproperty double y\nproperty double z\n") + "0 1e300 0\n",
       Code::BadValue, "no vertex has a position (a finite one, within 1e30 m)"},
      {"NaN positions alone", head("ascii", vertices("2")) + "nan 0 0\n0 nan 0\n", Code::BadValue, "no vertex"},
      {"letters for a number", head("ascii", vertices("2")) + "0 0 0\n0 zero 0\n", Code::BadValue, "vertex 1"},
      {"decimal commas", head("ascii", vertices("1")) + "0,5 0 0\n", Code::BadValue, "decimal comma"},
      {"commas between values", head("ascii", vertices("1")) + "0, 0, 0\n", Code::BadValue, "separated by blanks"},
      {"number for ever", head("ascii", vertices("1")) + std::string(500'000, '1') + " 0 0\n", Code::BadValue,
       "characters"},
      {"too few values", head("ascii", vertices("2")) + "0 0\n0 0 0 0\n", Code::BadValue, "vertex 0 has fewer"},
      {"too many values", head("ascii", vertices("2")) + "0 0 0 0\n0 0 0\n", Code::BadValue, "vertex 0 has more"},
      {"lines missing", head("ascii", vertices("2")) + "0 0 0.000000000\n", Code::Truncated, "vertex 1"},
      {"ascii list of -1", ascii_faces("1", "-1\n"), Code::BadValue, "-1"},
      {"ascii list too long", ascii_faces("1", "999999999 0 1 2\n"), Code::Truncated, "999999999"},
      {"ascii index with a fraction", ascii_faces("1", "3 0 1 1.5\n"), Code::BadValue, "face 0"},
      {"ascii index too large", ascii_faces("1", "3 0 1 99999999999999999999\n"), Code::BadValue, "face 0"},
      {"faces without a list", head("ascii", vertices("1") + "element face 1\nproperty int a\n") + "0 0 0\n0\n",
       Code::BadHeader, "vertex_indices"},
      {"indices that are no list",
       head("ascii", vertices("1") + "element face 1\nproperty int vertex_indices\n") + "0 0 0\n0\n", Code::BadHeader,
       "no list"},
      {"both names of the list",
       head("ascii", vertices("1") + "element face 1\nproperty list uchar int vertex_index\n"
                                     "property list uchar int vertex_indices\n") +
           "0 0 0\n0 0\n",
       Code::BadHeader, "both"},
      {"triangle strips",
       head("ascii", vertices("3") + "element tristrips 1\nproperty list int int vertex_indices\n") +
           "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
       std::nullopt, ""},
      {"triangle strip past the end",
       head("ascii", vertices("3") + "element tristrips 1\nproperty list int int vertex_indices\n") +
           "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
       Code::BadValue, "vertex 3"},
      {"colour of 256", head("ascii", vertices("1") + std::string(test::kRgb)) + "0 0 0 256 0 0\n", Code::BadValue,
       "'red'"},
      {"float colour of 200",
       head("ascii", vertices("1") + "property float red\nproperty float green\nproperty float blue\n") +
           "0 0 0 0 0 70000\n",
       Code::BadValue, "70000"},
      {"name that would turn a terminal red",
       head("ascii", "element \x1b[31m 1\nproperty list uchar int \x1b[0m\n" + vertices("1")) + "-3 0 0 0 0 0\n",
       Code::BadValue, "?[31m 0"},
  };
  std::string many = "element vertex 1\n" + kXyzText;
  for (int i = 0; i < 12'000; ++i) many += "property char p" + std::to_string(i) + "\n";
  files.push_back({"twelve thousand properties", binary_head(many) + std::string(12'012, '\0'), std::nullopt, ""});
  return files;
}

TEST(HostilePly, IsRefusedClearlyInBoundedMemory) {
  const auto files = hostile_files();
  ASSERT_GE(files.size(), 50U);
  const test::TemporaryFolder folder;
  for (const HostileFile& file : files) {
    SCOPED_TRACE(file.name);
    const auto path = folder.write("evil.ply", file.bytes);
    const test::AllocationMeter meter;
    {
      const auto scene = read_ply(path);
      ASSERT_EQ(scene.has_error(), file.code.has_value()) << (scene ? "no error" : scene.error().message);
      if (!scene) {
        EXPECT_EQ(scene.error().code, *file.code) << scene.error().message;
        EXPECT_NE(scene.error().message.find(file.says), std::string::npos) << scene.error().message;
        EXPECT_EQ(scene.error().message.rfind("evil.ply: ", 0), 0U) << scene.error().message;
        EXPECT_EQ(scene.error().message.find_first_of("\n\x1b"), std::string::npos);
        EXPECT_LT(scene.error().message.size(), 300U);
      }
    }
    EXPECT_LT(meter.peak_bytes(), 4'000'000U + 24 * file.bytes.size());
  }
}

/// Every file that is cut off somewhere is an error, or at most loses what came after its last element.
TEST(HostilePly, IsNoticedWhereverItIsCutOff) {
  const std::string whole = binary_head(vertices("3") +
                                        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                        "property list uchar short tags\nelement face 1\n" +
                                        kFaceText) +
                            [] {
                              PlyBytes body;
                              for (std::uint8_t i = 0; i < 3; ++i) {
                                body.le(static_cast<float>(i)).le(static_cast<float>(i * i)).le(0.0F).le(i).le(i).le(i);
                                body.le(std::uint8_t{1}).le(std::int16_t{5});
                              }
                              body.le(std::uint8_t{3}).le(0U).le(1U).le(2U);
                              return body.bytes();
                            }();
  ASSERT_TRUE(test::read_bytes(whole));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto scene = test::read_bytes(whole.substr(0, size));
    ASSERT_FALSE(scene) << size;
    EXPECT_TRUE(scene.error().code == base::ErrorCode::Truncated || scene.error().code == base::ErrorCode::BadHeader)
        << size;
  }
}

/// Any single byte that is another one gives a scene or an error, nothing else.
TEST(HostilePly, BearsEveryFlippedByte) {
  const std::string whole = ascii_faces("2", "3 0 1 2\n4 0 1 2 1\n");
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const char byte : {'\0', '\n', ' ', '-', '9', '\xff'}) {
      std::string changed = whole;
      changed[at] = byte;
      const auto scene = test::read_bytes(changed);
      if (!scene) {
        EXPECT_FALSE(scene.error().message.empty());
      } else {
        EXPECT_GT(scene.value().mesh.vertex_count(), 0U);
      }
    }
  }
}

}  // namespace
}  // namespace spectra::files
