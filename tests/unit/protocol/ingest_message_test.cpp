#include "protocol/ingest_message.hpp"

#include <gtest/gtest.h>

namespace spectra::protocol {
namespace {

const IngestHeader kExample{IngestKind::Put, 0x0000'1234'5678'9abc, 0x0102, 0xfedcba98};

TEST(IngestMessage, PutsEveryFieldWhereTheTableSays) {
  const auto bytes = encoded_header(kExample);
  const std::array<int, kIngestHeaderSize> expected{'S',  'P',  'I',  '1',  1,    0, 0x02, 0x01, 0xbc, 0x9a,
                                                    0x78, 0x56, 0x34, 0x12, 0x00, 0, 0x98, 0xba, 0xdc, 0xfe};
  for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(std::to_integer<int>(bytes.at(i)), expected.at(i)) << i;
}

TEST(IngestMessage, ComesBack) {
  for (const auto kind : {IngestKind::Put, IngestKind::Remove, static_cast<IngestKind>(200)}) {
    IngestHeader header = kExample;
    header.kind = kind;
    const auto back = decoded_ingest_header(encoded_header(header));
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back.value().kind, kind);
    EXPECT_EQ(back.value().sequence, header.sequence);
    EXPECT_EQ(back.value().target_size_bytes, header.target_size_bytes);
    EXPECT_EQ(back.value().body_size_bytes, header.body_size_bytes);
    EXPECT_EQ(back.value().message_size_bytes(), 20U + 0x0102U + 0xfedcba98U);
  }
}

TEST(IngestMessage, IsRefusedWhereverItIsCutShort) {
  const auto bytes = encoded_header(kExample);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto cut = decoded_ingest_header(std::span(bytes).first(size));
    ASSERT_FALSE(cut) << size;
    EXPECT_NE(cut.error().message.find(std::to_string(size) + " bytes"), std::string::npos);
  }
}

TEST(IngestMessage, NamesWhatIsWrong) {
  const auto field = [](std::size_t at, int value) {
    auto bytes = encoded_header(kExample);
    bytes.at(at) = static_cast<std::byte>(value);
    const auto read = decoded_ingest_header(bytes);
    return read ? std::string("nothing") : read.error().field + ": " + read.error().message;
  };
  EXPECT_EQ(field(3, '2').find("magic: block message: a version"), 0U) << field(3, '2');
  EXPECT_EQ(field(0, 'X').find("magic: block message: does not begin"), 0U) << field(0, 'X');
  EXPECT_EQ(field(5, 1).find("reserved"), 0U);
  EXPECT_EQ(field(14, 0x20).find("sequence"), 0U);
  IngestHeader none = kExample;
  none.sequence = 0;
  EXPECT_FALSE(decoded_ingest_header(encoded_header(none)));
  none.sequence = kLargestIngestSequence;
  EXPECT_TRUE(decoded_ingest_header(encoded_header(none)));
}

}  // namespace
}  // namespace spectra::protocol
