#include "fusion/files/scene_survey.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fusion/files/up_search.hpp"
#include "loaded.hpp"

namespace spectra::files {
namespace {

using test::note_count;

std::string told(std::vector<std::string> comments) {
  const auto up = up_told(comments);
  return up ? std::string(to_string(*up)) : "nothing";
}

TEST(UpAxis, HasSixNames) {
  for (const std::string_view name : {"x", "y", "z", "-x", "-y", "-z"}) {
    ASSERT_TRUE(base::up_axis(name)) << name;
    EXPECT_EQ(to_string(*base::up_axis(name)), name);
  }
  for (const std::string_view name : {"X", "+x", "+X"}) EXPECT_EQ(base::up_axis_written(name), base::UpAxis::X) << name;
  EXPECT_EQ(base::up_axis_written("-Z"), base::UpAxis::MinusZ);
  for (const std::string_view name : {"", "+-z", "up", "auto", "+", "XX"})
    EXPECT_FALSE(base::up_axis_written(name)) << name;
  for (const std::string_view name : {"", "X", "+z", "up", "auto", "zz"}) EXPECT_FALSE(base::up_axis(name)) << name;
  EXPECT_EQ(base::direction_of(base::UpAxis::MinusY), (base::Vec3f{0, -1, 0}));
  EXPECT_EQ(base::direction_of(base::UpAxis::X), (base::Vec3f{1, 0, 0}));
}

TEST(UpSearch, ReadsWhatProgramsAndPeopleWrite) {
  for (const char* line : {"comment up y",
                           "comment up: y",
                           "comment Y-up",
                           "comment y up",
                           "comment Z is not here, Y_UP",
                           "obj_info up axis: y",
                           "obj_info up_axis = +Y",
                           "comment upAxis y",
                           "comment UpAxis=Y",
                           "comment vertical axis: y",
                           "comment the y axis points up",
                           "comment up vector (0, 1, 0)",
                           "comment up = 0 1 0",
                           "comment up direction 0.0 1.0 0.0",
                           "comment xyz metres, y = elevation above minimum",
                           "comment y: height",
                           "comment yup",
                           "comment scene up: y",
                           "comment axis up Y forward -Z",
                           "comment axes: up Y, forward -Z",
                           "comment right-handed, up Y forward -Z",
                           "comment please use up axis: y",
                           "comment gravity 0 -9.81 0",
                           "obj_info gravity vector = [0, -1, 0]",
                           "comment gravity: -y",
                           "comment exported with forward -Z, up Y",
                           "comment Exported from Blender axis_forward=-Z axis_up=Y",
                           "comment not z up, y up",
                           "comment not z up but y up"}) {
    EXPECT_EQ(told({line}), "y") << line;
  }
  for (const char* line : {"comment x right, y down, z forward", "comment up -y", "comment up axis = -Y",
                           "comment up vector: [0, -1, 0]", "comment -y up", "comment gravity: 0 9.81 0"}) {
    EXPECT_EQ(told({line}), "-y") << line;
  }
  EXPECT_EQ(told({"comment frame ENU"}), "z");
  EXPECT_EQ(told({"comment NED coordinates, metres"}), "-z");
  EXPECT_EQ(told({"comment made by hand", "obj_info num_cols 3", "comment X up"}), "x");
}

TEST(UpSearch, ReadsNothingIntoOtherWords) {
  for (const char* line : {"comment scaled up x 2",
                           "comment cleaned up z noise",
                           "comment max-z grid 3.0 m",
                           "comment menu backup",
                           "comment xyz metres; single frame back-projected",
                           "comment x, y, z, up to date",
                           "comment y 12 up",
                           "comment up vector (1, 1, 0)",
                           "comment up vector (0, 1",
                           "comment up",
                           "comment",
                           "",
                           "obj_info",
                           "comment height y",
                           "comment up vector (0, nan, 0)",
                           "comment not y up",
                           "comment do not use y up",
                           "comment there is no y up",
                           "comment never load it y up",
                           "comment cleaned, up z noise",
                           "comment not up y",
                           "comment gravity 1 1 1",
                           "comment pick up: y",
                           "comment backed up = y",
                           "comment set up: x 3, y 2",
                           "comment warm-up: y",
                           "comment axis up to y",
                           "comment area covered y up to 3 m",
                           "comment building: y up to 12.5",
                           "comment z is 0, y up from there"}) {
    EXPECT_EQ(told({line}), "nothing") << line;
  }
  EXPECT_EQ(told({"comment y up", "comment z up"}), "nothing") << "they do not agree";
}

/// A bumpy sheet: `extents` long, thin along `thin`, `height` high; 40 x 40 vertices.
LoadedScene sheet(double width, double height, std::size_t thin, bool has_triangles = true) {
  constexpr std::uint32_t kSide = 40;
  LoadedScene scene;
  scene.mesh.resize_vertices(kSide * kSide);
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    const double u = i % kSide;
    const double v = i / kSide;
    std::array<float, 3> p{};
    p[thin] = static_cast<float>(height * (0.5 + 0.5 * std::sin(0.4 * u) * std::cos(0.3 * v)));
    p[(thin + 1) % 3] = static_cast<float>(width * u / (kSide - 1));
    p[(thin + 2) % 3] = static_cast<float>(width * v / (kSide - 1));
    scene.mesh.positions()[i] = {p[0], p[1], p[2]};
    if (has_triangles && i % kSide + 1 < kSide && i / kSide + 1 < kSide) {
      scene.mesh.triangles().push_back({i, i + 1, i + kSide});
      scene.mesh.triangles().push_back({i + 1, i + kSide + 1, i + kSide});
    }
  }
  return scene;
}

base::UpAxis up_of(LoadedScene scene, const ReadOptions& options = {}) {
  survey(scene, options);
  EXPECT_EQ(note_count(scene, "up_found"), scene.mesh.up != base::UpAxis::Z && !options.up ? 1U : 0U);
  return scene.mesh.up;
}

TEST(SceneSurvey, SeesWhichWayIsUpInMapsOnly) {
  for (const bool has_triangles : {true, false}) {
    EXPECT_EQ(up_of(sheet(2000, 90, 1, has_triangles)), base::UpAxis::Y);
    EXPECT_EQ(up_of(sheet(2000, 90, 0, has_triangles)), base::UpAxis::X);
    EXPECT_EQ(up_of(sheet(2000, 90, 2, has_triangles)), base::UpAxis::Z);
    EXPECT_EQ(up_of(sheet(20, 0.9, 1, has_triangles)), base::UpAxis::Z) << "a wall";
    EXPECT_EQ(up_of(sheet(2000, 900, 1, has_triangles)), base::UpAxis::Z) << "not flat";
  }
}

TEST(SceneSurvey, TakesUpAsItIsTold) {
  ReadOptions wanted;
  wanted.up = base::UpAxis::MinusX;
  EXPECT_EQ(up_of(sheet(2000, 90, 1), wanted), base::UpAxis::MinusX);
  wanted.up = base::UpAxis::Z;
  EXPECT_EQ(up_of(sheet(2000, 90, 1), wanted), base::UpAxis::Z);
  LoadedScene map = sheet(2000, 90, 1);
  map.comments = {"comment up z"};
  EXPECT_EQ(up_of(std::move(map)), base::UpAxis::Z);
  LoadedScene wall = sheet(20, 0.9, 2);
  wall.comments = {"comment Y-up"};
  survey(wall);
  EXPECT_EQ(wall.mesh.up, base::UpAxis::Y);
  ASSERT_EQ(note_count(wall, "up_found"), 1U);
  EXPECT_EQ(wall.notes.back().message, "y is taken for up, as the file's comments say; --up z takes z");
}

TEST(SceneSurvey, NoticesMillimetresWhereTheyArePlausible) {
  const auto is_noticed = [](LoadedScene scene, std::optional<double> metres_per_unit = {}) {
    ReadOptions options;
    options.metres_per_unit = metres_per_unit;
    survey(scene, options);
    for (const Note& note : scene.notes) {
      if (note.id == "may_be_millimetres") {
        EXPECT_TRUE(note.needs_attention);
        EXPECT_NE(note.message.find("--scale 0.001"), std::string::npos);
      }
    }
    return note_count(scene, "may_be_millimetres") == 1;
  };
  EXPECT_TRUE(is_noticed(sheet(3000, 400, 2)));
  EXPECT_FALSE(is_noticed(sheet(3, 0.4, 2)));
  EXPECT_FALSE(is_noticed(sheet(3000, 400, 2), 0.5)) << "a person has said what it counts in";
  EXPECT_FALSE(is_noticed(sheet(9000, 350, 2))) << "as flat as a map";
  LoadedScene in_metres = sheet(3000, 400, 2);
  in_metres.comments = {"comment xyz metres; a quarry"};
  EXPECT_FALSE(is_noticed(std::move(in_metres)));
  LoadedScene about_millimetres = sheet(3000, 400, 2);
  about_millimetres.comments = {"comment accuracy 2 millimetres", "comment parameters"};
  EXPECT_TRUE(is_noticed(std::move(about_millimetres)));
  LoadedScene on_a_map = sheet(3000, 400, 2);
  on_a_map.mesh.origin = {412345, 5461234, 0};
  EXPECT_FALSE(is_noticed(std::move(on_a_map)));
  LoadedScene astray = sheet(3, 0.4, 2);
  astray.mesh.positions()[0] = {9000, 9000, 9000};
  EXPECT_FALSE(is_noticed(std::move(astray))) << "one stray point makes no large scene";
}

TEST(SceneSurvey, KnowsWhetherAnybodySaidThatItIsMetric) {
  const auto is_metric = [](std::vector<std::string> comments, std::optional<double> metres_per_unit = {}) {
    LoadedScene scene = sheet(3, 0.4, 2);
    scene.comments = std::move(comments);
    ReadOptions options;
    options.metres_per_unit = metres_per_unit;
    survey(scene, options);
    return scene.mesh.is_metric;
  };
  EXPECT_FALSE(is_metric({}));
  EXPECT_FALSE(is_metric({"comment millimetres", "comment parameters"}));
  EXPECT_TRUE(is_metric({"comment xyz metres; a quarry"}));
  EXPECT_TRUE(is_metric({"obj_info unit: meter"}));
  EXPECT_TRUE(is_metric({"comment units: m"}));
  EXPECT_TRUE(is_metric({"obj_info unit=M, z up"}));
  EXPECT_FALSE(is_metric({"comment not in metres"}));
  for (const char* line :
       {"comment units per meter 1000", "comment 1000 units per metre", "comment points per square metre 80"}) {
    EXPECT_FALSE(is_metric({line})) << line;
  }
  EXPECT_FALSE(is_metric({"comment m"})) << "a letter, unless it is said to be the unit";
  EXPECT_FALSE(is_metric({"comment units: m of a map"}));
  EXPECT_TRUE(is_metric({"comment in m"}));
  EXPECT_TRUE(is_metric({"comment 1 unit = 1 m"}));
  EXPECT_TRUE(is_metric({"comment units: m."}));
  EXPECT_FALSE(is_metric({"comment in m, as of 2020"}));
  for (const char* line : {"comment units: \xC2\xB5m", "comment units: \xCE\xBCm", "comment units: \xB5m"}) {
    EXPECT_FALSE(is_metric({line})) << "a millionth of it";
  }
  EXPECT_TRUE(is_metric({}, 0.001));
  EXPECT_TRUE(is_metric({}, 1)) << "said, although it changes nothing";
}

TEST(SceneSurvey, NamesTheScaleOfTheUnitThatCommentsTell) {
  const auto said = [](const std::string& comment, std::optional<double> metres_per_unit = {}) {
    LoadedScene scene = sheet(3000, 400, 2);
    scene.comments = {comment};
    ReadOptions options;
    options.metres_per_unit = metres_per_unit;
    survey(scene, options);
    EXPECT_EQ(note_count(scene, "unit_told") + note_count(scene, "may_be_millimetres"), scene.mesh.is_metric ? 0U : 1U)
        << comment;
    for (const Note& note : scene.notes) {
      if (note.id == "unit_told") return note.message.substr(note.message.find("--scale"));
    }
    return std::string();
  };
  for (const char* line : {"comment units: mm", "comment 1 unit = 1 mm", "comment all values in millimetres",
                           "obj_info unit=MM", "comment coordinates (mm)", "comment XYZ in millimeters"}) {
    EXPECT_EQ(said(line), "--scale 0.001 makes metres of them") << line;
  }
  EXPECT_EQ(said("obj_info units centimeters"), "--scale 0.01 makes metres of them");
  EXPECT_EQ(said("comment Units: inch"), "--scale 0.0254 makes metres of them");
  EXPECT_EQ(said("comment units in"), "--scale 0.0254 makes metres of them");
  EXPECT_EQ(said("comment unit feet"), "--scale 0.3048 makes metres of them");
  EXPECT_EQ(said("comment lengths in ft"), "--scale 0.3048 makes metres of them");
  EXPECT_EQ(said("comment units: um"), "--scale 0.000001 makes metres of them");
  for (const char* line :
       {"comment mm", "obj_info mm", "comment in mm", "comment [mm]", "comment Millimetres.", "comment all in mm",
        "comment everything is in millimeters", "comment mm units", "comment coordinates in mm."}) {
    EXPECT_EQ(said(line), "--scale 0.001 makes metres of them") << line;
  }
  EXPECT_EQ(said("comment inches"), "--scale 0.0254 makes metres of them");
  EXPECT_EQ(said("comment in inches"), "--scale 0.0254 makes metres of them");
  EXPECT_EQ(said("obj_info in feet"), "--scale 0.3048 makes metres of them");
  EXPECT_EQ(said("comment units: \xC2\xB5m"), "--scale 0.000001 makes metres of them");
  for (const char* line : {"comment foot", "comment feet", "comment um", "comment in", "comment in in", "comment mm 2",
                           "comment in mm, roughly", "comment accuracy in mm", "comment mm cm", "comment not in mm"}) {
    EXPECT_EQ(said(line), "") << line;
  }
  for (const char* line :
       {"comment accuracy 2 mm", "comment points every 5 mm", "comment values in order", "comment unit: metre",
        "comment units in use", "comment scale 0.001 (mm to m)", "comment a foot"}) {
    EXPECT_EQ(said(line), "") << line;
  }
  EXPECT_EQ(said("comment units: mm", 0.001), "");
}

TEST(SceneSurvey, TakesALoneUnitOnlyWhereNothingElseSaysAnother) {
  const auto unit = [](std::vector<std::string> comments) {
    LoadedScene scene = sheet(3, 0.4, 2);
    scene.comments = std::move(comments);
    survey(scene);
    return scene.mesh.told.unit;
  };
  EXPECT_EQ(unit({"comment made by hand", "comment inches", "comment in inches"}), "inches");
  EXPECT_EQ(unit({"comment inches", "comment mm"}), "");
  EXPECT_EQ(unit({"comment inches", "comment units: mm"}), "millimetres");
  EXPECT_EQ(unit({"comment mm", "comment converted to metres"}), "metres");
}

TEST(SceneSurvey, BearsScenesOfNothing) {
  for (const std::size_t count : {0U, 1U, 2U, 144U}) {
    LoadedScene scene;
    scene.mesh.resize_vertices(count);
    survey(scene);
    EXPECT_EQ(scene.mesh.up, base::UpAxis::Z);
    EXPECT_TRUE(scene.notes.empty());
    EXPECT_TRUE(scene.core_bounds);
  }
}

}  // namespace
}  // namespace spectra::files
