#include "server/exports/export_shelf.hpp"

#include <gtest/gtest.h>

namespace spectra::exports {
namespace {

TEST(ExportShelf, BoundsWhatIsMadeAtATime) {
  ExportShelf shelf(2, 1000);
  auto one = shelf.take(), two = shelf.take();
  EXPECT_TRUE(one);
  EXPECT_TRUE(two);
  EXPECT_FALSE(shelf.take());
  one.reset();
  EXPECT_TRUE(shelf.take());
}

TEST(ExportShelf, SharesAFileAsLongAsSomebodyIsSentIt) {
  ExportShelf shelf(2, 1000);
  auto kept = shelf.keep("1/scene.ply", {"bytes", "lost"});
  EXPECT_EQ(shelf.find("1/scene.ply"), kept);
  EXPECT_EQ(shelf.find("2/scene.ply"), nullptr);
  EXPECT_EQ(kept->losses, "lost");
  kept.reset();
  EXPECT_EQ(shelf.find("1/scene.ply"), nullptr);
  const auto alone = shelf.keep("", {"bytes", ""});
  EXPECT_EQ(shelf.find(""), nullptr) << "of nobody else";
}

TEST(ExportShelf, MakesNoMoreWhileTooMuchIsSent) {
  ExportShelf shelf(2, 1000);
  auto large = shelf.keep("a", {std::string(1000, 'x'), ""});
  EXPECT_FALSE(shelf.take());
  large.reset();
  EXPECT_TRUE(shelf.take());
}

}  // namespace
}  // namespace spectra::exports
