#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/io/stereo_layouts.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;

const std::string kValid = R"(first:
  title: A title
  layout: kitti2015
  folders: [a/b, b]
  scenes: 3
second: {title: B, layout: middlebury_eval3, folders: [c], generated: true}
)";

class StereoLayoutsTest : public ::testing::Test {
 protected:
  std::vector<StereoDatasetEntry> Read(const std::string& text) const {
    return ReadStereoLayouts(dir_.Write("stereo_layouts.yaml", text));
  }
  std::string Message(const std::string& text) const {
    return ErrorMessage([&] { Read(text); });
  }
  const TempDir dir_;
};

TEST_F(StereoLayoutsTest, ReadsEntriesInTheOrderOfTheFile) {
  const auto entries = Read(kValid);
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(entries[0].name, "first");
  EXPECT_EQ(entries[0].title, "A title");
  EXPECT_EQ(entries[0].layout, StereoLayout::kKitti2015);
  EXPECT_THAT(entries[0].folders, ElementsAre("a/b", "b"));
  EXPECT_EQ(entries[0].scenes, 3);
  EXPECT_FALSE(entries[0].generated);
  EXPECT_EQ(entries[1].name, "second");
  EXPECT_TRUE(entries[1].generated);
}

TEST_F(StereoLayoutsTest, FindsTheFirstFolderThatExists) {
  const auto entry = Read(kValid)[0];
  EXPECT_FALSE(FindDataset(entry, dir_.path()));
  EXPECT_FALSE(FindDataset(entry, dir_.path() / "missing"));
  dir_.File("b/file");
  EXPECT_EQ(FindDataset(entry, dir_.path()), dir_.path() / "b");
  dir_.File("a/b/file");
  EXPECT_EQ(FindDataset(entry, dir_.path()), dir_.path() / "a/b");
}

TEST_F(StereoLayoutsTest, DoesNotTakeAFileForADataset) {
  dir_.Write("b", "a file");
  EXPECT_FALSE(FindDataset(Read(kValid)[0], dir_.path()));
}

TEST_F(StereoLayoutsTest, NamesFileLineAndKeyOfWhatIsWrong) {
  EXPECT_THAT(Message("a:\n  title: A\n  folder: [x]\n"),
              EndsWith("stereo_layouts.yaml:3: unknown key 'folder'"));
  EXPECT_THAT(
      Message("a:\n  title: A\n  layout: eth3d\n"),
      HasSubstr(
          "stereo_layouts.yaml:3: layout is 'eth3d'; known: middlebury_eval3, middlebury2001"));
  EXPECT_THAT(Message("a: {scenes: many}"),
              HasSubstr("stereo_layouts.yaml:1: cannot read 'many' as the value of scenes"));
  EXPECT_THAT(Message(kValid + kValid),
              EndsWith("stereo_layouts.yaml:7: dataset first is there twice"));
  EXPECT_THAT(Message("a: {title: A, layout: kitti2015,\n folders: [ok, /root]}"),
              EndsWith("stereo_layouts.yaml:2: folder '/root' is not relative to a data root"));
}

TEST_F(StereoLayoutsTest, NamesWhatAnEntryLacks) {
  EXPECT_THAT(Message("\na: {layout: kitti2015, folders: [x]}"),
              EndsWith("stereo_layouts.yaml:2: dataset a has no title"));
  EXPECT_THAT(Message("a: {title: A, folders: [x]}"), EndsWith("dataset a has no layout"));
  EXPECT_THAT(Message("a: {title: A, layout: kitti2015}"), EndsWith("dataset a has no folders"));
  EXPECT_THAT(Message("a: {title: A, layout: kitti2015, folders: []}"),
              EndsWith("stereo_layouts.yaml:1: expected at least one folder"));
  EXPECT_THAT(Message("a:\n"), EndsWith("dataset a has no title"));
}

TEST_F(StereoLayoutsTest, NamesFileAndLineOfInvalidYaml) {
  EXPECT_THAT(Message("a: {title: A\nb: ["), HasSubstr("stereo_layouts.yaml:"));
  EXPECT_THAT(Message("a:\n\t- b"), HasSubstr("stereo_layouts.yaml:2: "));
  EXPECT_THAT(Message("[a, b]"), EndsWith("stereo_layouts.yaml:1: expected a map of datasets"));
  EXPECT_THAT(Message(""), HasSubstr("expected a map of datasets"));
  EXPECT_THAT(Message("? [a]\n: {}"), HasSubstr("stereo_layouts.yaml:1: "));
  EXPECT_THAT(Message("a: {title: A, ? [b] : c}"), HasSubstr("stereo_layouts.yaml:1: "));
  EXPECT_THAT(ErrorMessage([&] { ReadStereoLayouts(dir_.path() / "none.yaml"); }),
              EndsWith("none.yaml: file does not exist"));
}

TEST(ProjectStereoLayouts, HasTheDatasetsOfTheTables) {
  std::map<std::string, StereoDatasetEntry> entries;
  for (auto& entry : ReadStereoLayouts(SGF_SOURCE_DIR "/datasets/stereo_layouts.yaml"))
    entries[entry.name] = entry;
  EXPECT_EQ(entries.at("middlebury2014_q").layout, StereoLayout::kMiddleburyEval3);
  EXPECT_EQ(entries.at("middlebury2014_h").scenes, 15);
  EXPECT_EQ(entries.at("kitti2015").layout, StereoLayout::kKitti2015);
  EXPECT_EQ(entries.at("kitti2012").layout, StereoLayout::kKitti2012);
  EXPECT_TRUE(entries.at("debian_pairs").generated);
  for (const auto& [name, entry] : entries) EXPECT_GT(entry.scenes, 0) << name;
}

}  // namespace
}  // namespace sgf
