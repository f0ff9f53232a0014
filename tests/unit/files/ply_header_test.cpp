#include "fusion/files/ply_header.hpp"

#include <gtest/gtest.h>

#include "loaded.hpp"

namespace spectra::files {
namespace {

TEST(PlyHeader, ReadsElementsAndProperties) {
  const auto header = parse_ply_header(
      "ply\nformat binary_big_endian 1.0\ncomment element vertex 9\nobj_info made by hand\n\n"
      "element vertex 3\nproperty  float\tx\nproperty list uint8 uint16 tags\nelement face 18446744073709551615\n"
      "end_header\nbody");
  ASSERT_TRUE(header);
  EXPECT_EQ(header.value().format, PlyFormat::BinaryBigEndian);
  ASSERT_EQ(header.value().elements.size(), 2U);
  const PlyElement& vertex = header.value().elements[0];
  EXPECT_EQ(vertex.count, 3U);
  ASSERT_EQ(vertex.properties.size(), 2U);
  EXPECT_EQ(vertex.properties[0].name, "x");
  EXPECT_EQ(vertex.properties[0].type, PlyScalar::Float32);
  EXPECT_TRUE(vertex.properties[1].is_list);
  EXPECT_EQ(vertex.properties[1].count_type, PlyScalar::UInt8);
  EXPECT_EQ(vertex.properties[1].type, PlyScalar::UInt16);
  EXPECT_EQ(header.value().find("face")->count, 18446744073709551615U);
  EXPECT_EQ(header.value().find("edge"), nullptr);
}

TEST(PlyHeader, BodyBeginsAfterTheLastLineEnd) {
  for (const std::string line_end : {"\n", "\r\n"}) {
    const std::string head =
        "ply" + line_end + "format ascii 1.0" + line_end + "element vertex 1" + line_end + "end_header" + line_end;
    const auto header = parse_ply_header(head + "\n1 2 3");
    ASSERT_TRUE(header);
    EXPECT_EQ(header.value().size_bytes, head.size());
  }
}

struct BadHeaderCase {
  const char* text;
  base::ErrorCode code;
  const char* says;
};

TEST(PlyHeader, SaysWhatIsWrong) {
  const BadHeaderCase cases[] = {
      {"", base::ErrorCode::BadHeader, "empty"},
      {"solid thing\n", base::ErrorCode::BadHeader, "not a PLY file"},
      {"plyx\n", base::ErrorCode::BadHeader, "not a PLY file"},
      {"ply\nformat ascii 1.0\n", base::ErrorCode::BadHeader, "before end_header"},
      {"ply\nend_header\n", base::ErrorCode::BadHeader, "no format"},
      {"ply\nformat ascii 2.0\nend_header\n", base::ErrorCode::Unsupported, "'2.0'"},
      {"ply\nformat utf8 1.0\nend_header\n", base::ErrorCode::Unsupported, "'utf8'"},
      {"ply\nformat ascii\nend_header\n", base::ErrorCode::BadHeader, "line 2"},
      {"ply\nformat ascii 1.0\nformat ascii 1.0\n", base::ErrorCode::BadHeader, "second format"},
      {"ply\nformat ascii 1.0\nvertex 3\n", base::ErrorCode::BadHeader, "'vertex'"},
      {"ply\nformat ascii 1.0\nproperty float x\n", base::ErrorCode::BadHeader, "before any element"},
      {"ply\nformat ascii 1.0\nelement vertex\n", base::ErrorCode::BadHeader, "name and a count"},
      {"ply\nformat ascii 1.0\nelement vertex -1\n", base::ErrorCode::BadHeader, "'-1'"},
      {"ply\nformat ascii 1.0\nelement vertex 3x\n", base::ErrorCode::BadHeader, "'3x'"},
      {"ply\nformat ascii 1.0\nelement vertex 18446744073709551616\n", base::ErrorCode::BadHeader, "2^64"},
      {"ply\nformat ascii 1.0\nelement a 1\nelement a 1\n", base::ErrorCode::BadHeader, "second element 'a'"},
      {"ply\nformat ascii 1.0\nelement a 1\nproperty half h\n", base::ErrorCode::BadHeader, "'half'"},
      {"ply\nformat ascii 1.0\nelement a 1\nproperty float\n", base::ErrorCode::BadHeader, "property line"},
      {"ply\nformat ascii 1.0\nelement a 1\nproperty list uchar int\n", base::ErrorCode::BadHeader, "property line"},
      {"ply\nformat ascii 1.0\nelement a 1\nproperty list float int l\n", base::ErrorCode::BadHeader, "'float'"},
      {"ply\nformat ascii 1.0\n\x1b[31m\n", base::ErrorCode::BadHeader, "'?[31m'"},
  };
  for (const BadHeaderCase& bad : cases) {
    const auto header = parse_ply_header(bad.text);
    ASSERT_FALSE(header) << bad.text;
    EXPECT_EQ(header.error().code, bad.code) << bad.text;
    EXPECT_NE(header.error().message.find(bad.says), std::string::npos) << header.error().message;
  }
}

TEST(PlyHeader, TellsPropertiesOfOneNameApart) {
  const std::string head = "ply\nformat ascii 1.0\nelement a 1\n";
  const auto header = parse_ply_header(head + "property int i\nproperty float i\nproperty int i\nend_header\n");
  ASSERT_TRUE(header) << header.error().message;
  const auto& properties = header.value().elements[0].properties;
  EXPECT_EQ(properties[0].name, "i");
  EXPECT_EQ(properties[1].name, "i (2)");
  EXPECT_EQ(properties[2].name, "i (3)");
  std::string many = head;
  for (int i = 0; i < 200; ++i) many += "property int i\n";
  EXPECT_FALSE(parse_ply_header(many + "end_header\n"));
}

TEST(PlyHeader, NamesAreShownAsTheyAreUnlessTheyCannotBe) {
  for (const char* name : {"temperature", "W\u00e4rme", "\u6e29\u5ea6", "\u2603 \U0001f321", "temp [\u00b0C]"}) {
    EXPECT_EQ(printable(name), name);
  }
  EXPECT_EQ(printable("a\x1b[31m\r\n\x7f\t"), "a?[31m????");
  EXPECT_EQ(printable("W\xe4rme"), "W?rme");                            // Latin-1
  EXPECT_EQ(printable("\xc0\xaf|\xed\xa0\x80|\xe6\xb8"), "??|???|??");  // Overlong, half a pair, cut short.
  EXPECT_EQ(printable("\xf4\x90\x80\x80|\xf5|\x80"), "????|?|?");
  EXPECT_EQ(printable("a\u009bb\u202ec\u2028d"), "a??b???c???d");  // They move a terminal or turn a line round.
  for (const std::string unseen :
       {"\u00ad", "\u061c", "\u180e", "\u200b", "\u2066", "\ufeff", "\ufff9", "\ufffb", "\U000110bd", "\U000110cd",
        "\U0001bca3", "\U000e0001", "\U000e0020", "\U000e007f"}) {
    EXPECT_EQ(printable("a" + unseen + "b"), "a" + std::string(unseen.size(), '?') + "b") << unseen.size();
  }
  for (const std::string seen : {"\u00ac", "\u00ae", "\u061b", "\u180d", "\ufffc", "\U000e0080"}) {
    EXPECT_EQ(printable("a" + seen + "b"), "a" + seen + "b");
  }
  std::string forty;
  for (int i = 0; i < 40; ++i) forty += "\u6e29";
  EXPECT_EQ(printable(forty), forty);
  EXPECT_EQ(printable(forty + "\u6e29"), forty + "...");
  const auto unknown =
      test::read_bytes("ply\nformat ascii 1.0\nelement vertex 1\nproperty float \u6e29\u5ea6\nend_header\n1\n");
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().message.find("(it has \u6e29\u5ea6)"), std::string::npos) << unknown.error().message;
}

TEST(PlyHeader, IsBoundedInSize) {
  std::string text = "ply\nformat ascii 1.0\n";
  while (text.size() < kMaxPlyHeaderBytes + 1000) text += "comment " + std::string(1000, 'c') + "\n";
  const auto header = parse_ply_header(text + "element vertex 1\nend_header\n");
  ASSERT_FALSE(header);
  EXPECT_NE(header.error().message.find("within the first"), std::string::npos);
}

}  // namespace
}  // namespace spectra::files
