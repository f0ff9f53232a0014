#include "fusion/files/ply_writer.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <limits>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_encoder.hpp"
#include "fusion/files/ply_reader.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

mesh::MultispectralMesh sample_mesh() {
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(3);
  mesh.positions()[0] = {0.1F, -2.5F, 1e-30F};
  mesh.positions()[1] = {1, 0, 0};
  mesh.positions()[2] = {0, 1, 0};
  mesh.temperature_celsius()[0] = 36.6F;
  mesh.temperature_celsius()[2] = -273.0F;
  mesh.has_temperature = true;
  mesh.triangles() = {{0, 1, 2}};
  return mesh;
}

const std::vector<base::Rgb8> kColours = {{1, 2, 3}, {4, 5, 6}, {255, 254, 253}};

std::string written(const mesh::MultispectralMesh& mesh) {
  std::ostringstream out;
  EXPECT_TRUE(write_ply(out, mesh, kColours));
  return out.str();
}

std::size_t entry_count(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()));
}

TEST(PlyWriter, WritesWhatItSays) {
  test::PlyBytes expected;
  expected.text(
      "ply\nformat binary_little_endian 1.0\ncomment written by Spectra\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
      "property uchar blue\nproperty float temperature\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n");
  const mesh::MultispectralMesh mesh = sample_mesh();
  for (std::size_t i = 0; i < 3; ++i) {
    const base::Vec3f& p = mesh.positions()[i];
    expected.le(p.x).le(p.y).le(p.z).le(kColours[i].r).le(kColours[i].g).le(kColours[i].b);
    expected.le(mesh.temperature_celsius()[i]);
  }
  expected.le(std::uint8_t{3}).le(0U).le(1U).le(2U);
  EXPECT_EQ(written(mesh), expected.bytes());
}

TEST(PlyWriter, KeepsHowSureTemperaturesAre) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  mesh::MultispectralMesh mesh = sample_mesh();
  EXPECT_TRUE(test::loaded(written(mesh)).mesh.confidence.empty());
  // A vertex without temperature is not sure of any.
  mesh.confidence = {{0.25F, 0.5F, -1}, {1'700'000'000.25, 3, 4}};
  mesh.left_out = {{1, {kNone, 0, 0}, {7, 7, 7}, 20}};
  const LoadedScene scene = test::loaded(written(mesh));
  ASSERT_EQ(scene.mesh.vertex_count(), 3U);
  ASSERT_EQ(scene.mesh.left_out.size(), 1U);
  EXPECT_EQ(scene.mesh.confidence.sigma_kelvin[0], 0.25F);
  EXPECT_EQ(scene.mesh.confidence.looked_at[0], 1'700'000'000.25);
  for (const std::size_t v : {1U, 2U}) {
    EXPECT_TRUE(std::isnan(scene.mesh.confidence.sigma_kelvin[v]));
    EXPECT_TRUE(std::isnan(scene.mesh.confidence.looked_at[v]));
  }
  for (const Note& note : scene.notes) EXPECT_NE(note.id, "skipped_vertex_properties") << note.message;

  ReadOptions options;
  options.temperature_unit = TemperatureUnit::Fahrenheit;
  EXPECT_NEAR(test::loaded(written(mesh), options).mesh.confidence.sigma_kelvin[0], 0.25 * 5 / 9, 1e-6);

  mesh.confidence = {{kNone, kNone, kNone}, {1, 2, 3}};
  EXPECT_TRUE(test::loaded(written(mesh)).mesh.confidence.empty()) << "costs nothing where nobody knows anything";
}

TEST(PlyWriter, RoundTripsAndLeavesOutWhatIsNotThere) {
  mesh::MultispectralMesh mesh = sample_mesh();
  const LoadedScene scene = test::loaded(written(mesh));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(scene.mesh.positions()[i], mesh.positions()[i]);
    EXPECT_EQ(scene.mesh.visible()[i], kColours[i]);
  }
  EXPECT_EQ(scene.mesh.temperature_celsius()[2], -273.0F);
  EXPECT_EQ(scene.mesh.triangles(), mesh.triangles());

  mesh.has_temperature = false;
  mesh.triangles().clear();
  const std::string bytes = written(mesh);
  EXPECT_EQ(bytes.find("temperature"), std::string::npos);
  EXPECT_EQ(bytes.find("face"), std::string::npos);
  EXPECT_TRUE(test::loaded(bytes).mesh.is_point_cloud());
}

TEST(PlyWriter, AddsTheOriginAndKeepsDoubles) {
  mesh::MultispectralMesh mesh = sample_mesh();
  mesh.origin = {4'157'216, 664'768, -8};
  mesh.double_positions = true;
  const std::string bytes = written(mesh);
  EXPECT_NE(bytes.find("property double x"), std::string::npos);
  const LoadedScene scene = test::loaded(bytes);
  EXPECT_EQ(scene.mesh.origin.x + static_cast<double>(scene.mesh.positions()[1].x), 4'157'217);
  EXPECT_NEAR(scene.mesh.origin.y + static_cast<double>(scene.mesh.positions()[0].y), 664'765.5, 1e-6);
}

TEST(PlyWriter, GivesFloatsFarAwayBackBitByBit) {
  test::PlyBytes file;
  file.text("ply\nformat binary_little_endian 1.0\ncomment written by Spectra\nelement vertex 3\n" +
            std::string(test::kXyz) + std::string(test::kRgb) + "end_header\n");
  const float xs[] = {448'000.03125F, 448'123.0F, 448'127.96875F};
  for (std::size_t i = 0; i < 3; ++i) {
    file.le(xs[i]).le(static_cast<float>(i) * 0.1F).le(-99.9F);
    file.le(kColours[i].r).le(kColours[i].g).le(kColours[i].b);
  }
  const LoadedScene scene = test::loaded(file.bytes());
  EXPECT_NE(scene.mesh.origin.x, 0);
  EXPECT_EQ(written(scene.mesh), file.bytes());
}

TEST(PlyWriter, RefusesColoursOfAnotherNumber) {
  std::ostringstream out;
  const auto result = write_ply(out, sample_mesh(), std::span(kColours).first(2));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::Inconsistent);
}

TEST(PlyWriter, SaysWhenAStreamFails) {
  std::ostringstream out;
  out.setstate(std::ios::badbit);
  const auto result = write_ply(out, sample_mesh(), kColours);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::FileUnwritable);
}

TEST(PlyWriter, ReplacesAFileAndKeepsItsPermissions) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("out.ply", "old");
  ASSERT_EQ(::chmod(path.c_str(), 0640), 0);
  ASSERT_TRUE(write_ply(path, sample_mesh(), kColours));
  EXPECT_EQ(test::file_bytes(path), written(sample_mesh()));
  struct stat facts {};
  ASSERT_EQ(::stat(path.c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 07777, 0640U);
  EXPECT_EQ(entry_count(folder.path()), 1U);
}

TEST(PlyWriter, WritesToARelativePath) {
  const test::TemporaryFolder folder;
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder.path());
  const auto result = write_ply("out.ply", sample_mesh(), kColours);
  std::filesystem::current_path(before);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(test::file_bytes(folder.path() / "out.ply"), written(sample_mesh()));
}

TEST(PlyWriter, WritesThroughASymbolicLink) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("real.ply", "old");
  std::filesystem::create_symlink("real.ply", folder.path() / "link.ply");
  ASSERT_TRUE(write_ply(folder.path() / "link.ply", sample_mesh(), kColours));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "link.ply"));
  EXPECT_EQ(test::file_bytes(path), written(sample_mesh()));
}

TEST(PlyWriter, WritesWhatALinkLeadsTo) {
  const test::TemporaryFolder folder;
  std::filesystem::create_symlink("middle.ply", folder.path() / "link.ply");
  std::filesystem::create_symlink(folder.path() / "new.ply", folder.path() / "middle.ply");
  ASSERT_TRUE(write_ply(folder.path() / "link.ply", sample_mesh(), kColours));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "link.ply"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path() / "middle.ply"));
  EXPECT_EQ(test::file_bytes(folder.path() / "new.ply"), written(sample_mesh()));
}

TEST(PlyWriter, WritesToAPipe) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  std::string received;
  std::thread reader([&] { received = test::file_bytes(path); });
  const auto result = write_ply(path, sample_mesh(), kColours);
  reader.join();
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(received, written(sample_mesh()));
}

TEST(PlyWriter, WritesToADescriptorUnderDev) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("out.ply", "");
  const int descriptor = ::open(path.c_str(), O_WRONLY);
  ASSERT_GE(descriptor, 0);
  const auto result = write_ply("/dev/fd/" + std::to_string(descriptor), sample_mesh(), kColours);
  ::close(descriptor);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(test::file_bytes(path), written(sample_mesh()));
}

TEST(PlyWriter, NamesTheFileItCannotWrite) {
  const test::TemporaryFolder folder;
  for (const std::filesystem::path& path : {folder.path() / "none" / "out.ply", folder.path(),
                                            std::filesystem::path("/dev/full"), std::filesystem::path("/dev/none")}) {
    const auto result = write_ply(path, sample_mesh(), kColours);
    ASSERT_FALSE(result) << path;
    EXPECT_EQ(result.error().code, base::ErrorCode::FileUnwritable);
    EXPECT_NE(result.error().message.find(path.string()), std::string::npos) << result.error().message;
    EXPECT_EQ(result.error().field, path.string());
  }
}

TEST(PlyWriter, LeavesTheOldFileAndNothingElseWhenTheDiskIsFull) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("out.ply", "old");
  // A limit on the size of files stands for the full disk: the write fails in the middle.
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tight{100, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &tight), 0);
  const auto result = write_ply(path, sample_mesh(), kColours);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::FileUnwritable);
  EXPECT_NE(result.error().message.find(path.string()), std::string::npos);
  EXPECT_EQ(test::file_bytes(path), "old");
  EXPECT_EQ(entry_count(folder.path()), 1U);
}

TEST(OutputFile, IsNotThereBeforeItIsCommitted) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "out.bin";
  const std::byte byte{7};
  {
    auto file = OutputFile::create(path);
    ASSERT_TRUE(file);
    ASSERT_TRUE(file.value().write({&byte, 1}));
    EXPECT_FALSE(std::filesystem::exists(path));
  }
  EXPECT_EQ(entry_count(folder.path()), 0U);
  auto file = OutputFile::create(path);
  ASSERT_TRUE(file);
  ASSERT_TRUE(file.value().write({&byte, 1}));
  ASSERT_TRUE(file.value().commit());
  EXPECT_EQ(test::file_bytes(path), "\x07");
}

TEST(OutputFile, OfSeveralThatBelongTogetherAllArePutInPlace) {
  const test::TemporaryFolder folder;
  const std::byte byte{7};
  std::vector<OutputFile> files;
  for (const auto* name : {"a", "b"}) {
    files.push_back(OutputFile::create(folder.path() / name).value());
    ASSERT_TRUE(files.back().write({&byte, 1}));
  }
  ASSERT_TRUE(OutputFile::commit_all(files));
  EXPECT_EQ(test::file_bytes(folder.path() / "a"), "\x07");
  EXPECT_EQ(test::file_bytes(folder.path() / "b"), "\x07");
  EXPECT_EQ(entry_count(folder.path()), 2U);
}

TEST(OutputFile, AbandonedLeavesWhatWasThereBefore) {
  const test::TemporaryFolder folder;
  const auto path = folder.write("out.bin", "old");
  const std::byte byte{7};
  const auto abandon_two = [&] {
    auto file = OutputFile::create(path);
    auto other = OutputFile::create(folder.path() / "other.bin");
    if (!file || !other || !file.value().write({&byte, 1}) || entry_count(folder.path()) != 3U) ::_exit(1);
    OutputFile::abandon_all();
    ::_exit(0);
  };
  EXPECT_EXIT(abandon_two(), testing::ExitedWithCode(0), "");
  EXPECT_EQ(test::file_bytes(path), "old");
  EXPECT_EQ(entry_count(folder.path()), 1U);
}

TEST(PlyEncoder, RefusesOtherNumbersThanItsHeaderHas) {
  PlyLayout layout;
  layout.vertex_count = 2;
  PlyEncoder encoder(layout, [](std::span<const std::byte>) -> base::Result<void> { return base::success(); });
  const base::Vec3f position;
  const base::Rgb8 colour;
  ASSERT_TRUE(encoder.vertices({&position, 1}, {&colour, 1}, {}));
  const auto result = encoder.finish();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::Inconsistent);
}

}  // namespace
}  // namespace spectra::files
