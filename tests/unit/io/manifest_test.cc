#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <sgf/core/error.h>
#include <sgf/io/hash.h>
#include <sgf/io/manifest.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/file_size_limit.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::StartsWith;

// Of the empty text and of "abc", from FIPS 180-4's examples.
constexpr const char* kHashOfNothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr const char* kHashOfAbc =
    "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

TEST(Sha256, IsTheStandards) {
  EXPECT_EQ(Sha256(""), kHashOfNothing);
  EXPECT_EQ(Sha256("abc"), kHashOfAbc);
}

TEST(Sha256, OfAFileIsThatOfItsBytes) {
  const TempDir dir;
  EXPECT_EQ(Sha256OfFile(dir.Write("empty", "")), kHashOfNothing);
  EXPECT_EQ(Sha256OfFile(dir.Write("abc", "abc")), kHashOfAbc);
  const std::string large(3'000'000, 'x');  // several blocks, the last not full
  EXPECT_EQ(Sha256OfFile(dir.Write("large", large)), Sha256(large));
}

TEST(Sha256, NamesTheFileThatCannotBeRead) {
  const TempDir dir;
  const fs::path missing = dir.path() / "missing";
  EXPECT_EQ(ErrorMessage([&] { Sha256OfFile(missing); }),
            missing.string() + ": is missing or no regular file");
  EXPECT_THAT(ErrorMessage([&] { Sha256OfFile(dir.path()); }), HasSubstr("no regular file"));
}

std::vector<std::string> Names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  return names;
}

// A folder of three files, two of them deeper.
fs::path MakeContent(const TempDir& dir, const std::string& name = "content") {
  dir.Write(name + "/b.txt", "abc");
  dir.Write(name + "/deep/er/a.txt", "");
  dir.Write(name + "/deep/c \"'.txt", "content");
  return dir.path() / name;
}

TEST(Manifest, ListsAllFilesWithSizesAndHashes) {
  const TempDir dir;
  const fs::path folder = MakeContent(dir);
  WriteManifest(folder, "recipe 1", {{"frames", 3}, {"imu_samples", 5'000'000'000}});
  const Manifest manifest = ReadManifest(folder);
  EXPECT_EQ(manifest.recipe_hash, "recipe 1");
  EXPECT_THAT(manifest.counts, ElementsAre(Pair("frames", 3), Pair("imu_samples", 5'000'000'000)));
  ASSERT_EQ(manifest.files.size(), 3U);
  EXPECT_EQ(manifest.files[0].path, "b.txt");
  EXPECT_EQ(manifest.files[0].size, 3U);
  EXPECT_EQ(manifest.files[0].sha256, kHashOfAbc);
  EXPECT_EQ(manifest.files[1].path, "deep/c \"'.txt");
  EXPECT_EQ(manifest.files[2].path, "deep/er/a.txt");
  EXPECT_EQ(manifest.files[2].sha256, kHashOfNothing);
}

TEST(Manifest, DependsOnTheContentOnly) {
  const TempDir dir;
  WriteManifest(MakeContent(dir, "one"), "r", {});
  WriteManifest(MakeContent(dir, "two"), "r", {});
  WriteManifest(dir.path() / "two", "r", {});  // over the first one, which it does not list
  EXPECT_EQ(ReadFile(dir.path() / "one" / kManifestName),
            ReadFile(dir.path() / "two" / kManifestName));
}

TEST(Manifest, MakesAFolderComplete) {
  const TempDir dir;
  const fs::path folder = MakeContent(dir);
  EXPECT_FALSE(IsComplete(folder, "r"));
  WriteManifest(folder, "r", {});
  EXPECT_TRUE(IsComplete(folder, "r"));
  EXPECT_FALSE(IsComplete(folder, "another recipe"));
  EXPECT_FALSE(IsComplete(dir.path() / "missing", "r"));
  CheckManifest(folder);
}

TEST(Manifest, NoticesWhatChangedSince) {
  const TempDir dir;
  const fs::path folder = MakeContent(dir);
  WriteManifest(folder, "r", {});
  const auto check = [&] { return ErrorMessage([&] { CheckManifest(folder); }); };

  dir.Write("content/b.txt", "abd");
  EXPECT_TRUE(IsComplete(folder, "r")) << "contents are not read";
  EXPECT_THAT(check(), HasSubstr("b.txt: has another content"));
  dir.Write("content/b.txt", "ab");
  EXPECT_FALSE(IsComplete(folder, "r"));
  EXPECT_THAT(check(), HasSubstr("b.txt: has 2 bytes, its manifest says 3"));
  fs::remove(folder / "b.txt");
  EXPECT_FALSE(IsComplete(folder, "r"));
  EXPECT_THAT(check(), HasSubstr("b.txt: is missing"));
  dir.Write("content/b.txt", "abc");
  dir.Write("content/deep/new.txt", "");
  EXPECT_TRUE(IsComplete(folder, "r"));
  EXPECT_THAT(check(), HasSubstr("deep/new.txt: is not in the manifest"));
}

TEST(Manifest, IsRefusedWhenCutOrChanged) {
  const TempDir dir;
  const fs::path folder = MakeContent(dir);
  WriteManifest(folder, "r", {{"frames", 3}});
  const std::string text = ReadFile(folder / kManifestName);
  const auto read = [&](const std::string& changed) {
    const auto path = dir.Write("content/" + std::string(kManifestName), changed);
    const std::string message = ErrorMessage([&] { ReadManifest(folder); });
    EXPECT_EQ(IsComplete(folder, "r"), message == "no error");
    EXPECT_THAT(message, AnyOf("no error", StartsWith(path.string() + ": damaged")));
    return message;
  };
  EXPECT_EQ(read(text), "no error");
  EXPECT_EQ(read(text.substr(0, text.size() - 1)), "no error") << "the last line end";
  // A path may be cut and still be one; its file is then missing, so the folder is not complete.
  const size_t last_path = text.rfind("deep/er/a.txt");
  for (size_t length = 0; length < last_path; ++length)
    ASSERT_NE(read(text.substr(0, length)), "no error") << text.substr(0, length);
  const auto with = [&](const std::string& old_text, const std::string& new_text) {
    return read(std::string(text).replace(text.find(old_text), old_text.size(), new_text));
  };
  EXPECT_THAT(with("total_files: 3", "total_files: 4"), HasSubstr("totals"));
  EXPECT_THAT(with("b.txt", "../b.txt"), HasSubstr("'../b.txt' is not in the folder"));
  EXPECT_THAT(with("b.txt", "/etc/b.txt"), HasSubstr("'/etc/b.txt' is not in the folder"));
  EXPECT_THAT(with("recipe:", "recipes:"), HasSubstr("no key recipe"));
}

TEST(Manifest, RefusesLinks) {
  const TempDir dir;
  const fs::path folder = MakeContent(dir);
  fs::create_symlink("b.txt", folder / "link");
  EXPECT_EQ(ErrorMessage([&] { WriteManifest(folder, "r", {}); }),
            (folder / "link").string() + ": is neither a regular file nor a folder");
}

TEST(StagedFolder, AppearsWhenCommittedAndNotBefore) {
  const TempDir dir;
  const fs::path target = dir.path() / "a" / "b" / "room";
  StagedFolder staged(target);
  std::ofstream(staged.path() / "left.png") << "pixels";
  EXPECT_FALSE(fs::exists(target));
  staged.Commit("r", {{"frames", 1}});
  EXPECT_TRUE(IsComplete(target, "r"));
  CheckManifest(target);
  EXPECT_THAT(Names(target.parent_path()), ElementsAre("room"));
}

TEST(StagedFolder, TakesATargetWithASlashAtItsEnd) {
  const TempDir dir;
  StagedFolder(dir.path() / "room" / "").Commit("r", {});
  EXPECT_THAT(Names(dir.path()), ElementsAre("room"));
}

TEST(StagedFolder, LeavesTheOldFolderUnlessCommitted) {
  const TempDir dir;
  const fs::path target = MakeContent(dir, "room");
  WriteManifest(target, "old", {});
  {
    const StagedFolder staged(target);
    std::ofstream(staged.path() / "left.png") << "pixels";
  }
  CheckManifest(target);
  EXPECT_TRUE(IsComplete(target, "old"));
  EXPECT_THAT(Names(dir.path()), ElementsAre("room"));
}

TEST(StagedFolder, ReplacesTheOldFolder) {
  const TempDir dir;
  const fs::path target = MakeContent(dir, "room");
  StagedFolder staged(target);
  std::ofstream(staged.path() / "left.png") << "pixels";
  staged.Commit("new", {});
  EXPECT_TRUE(IsComplete(target, "new"));
  CheckManifest(target);  // nothing of the old one is left
  EXPECT_THAT(Names(dir.path()), ElementsAre("room"));
}

TEST(StagedFolder, RemovesWhatAnInterruptedRunLeft) {
  const TempDir dir;
  dir.Write("room.partial/deep/old.png", "half");
  StagedFolder staged(dir.path() / "room");
  EXPECT_THAT(Names(staged.path()), IsEmpty());
}

TEST(StagedFolder, KeepsASecondWriterOut) {
  const TempDir dir;
  const fs::path target = dir.path() / "room";
  {
    StagedFolder first(target);
    std::ofstream(first.path() / "left.png") << "pixels";
    EXPECT_EQ(ErrorMessage([&] { StagedFolder second(target); }),
              first.path().string() + ": is being written by another process");
    first.Commit("r", {});
    CheckManifest(target);
    const StagedFolder next(target);  // the first one's lock is on its folder's new name
  }
  CheckManifest(target);
}

TEST(StagedFolder, NamesAFolderThatCannotBeMade) {
  const TempDir dir;
  const fs::path target = dir.Write("file", "") / "room";
  EXPECT_THAT(ErrorMessage([&] { StagedFolder staged(target); }),
              HasSubstr("room.partial: cannot be made"));
}

// Runs in a process of its own, so that it can end at any place.
template <class F>
int StatusOf(F&& work) {
  const pid_t child = fork();
  if (child == 0) {
    work();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST(StagedFolder, IsNeverWholeWhenTheProcessIsKilled) {
  const TempDir dir;
  const fs::path target = dir.path() / "room";
  const int status = StatusOf([&] {
    const StagedFolder staged(target);
    std::ofstream(staged.path() / "left.png") << "pixels";
    WriteManifest(staged.path(), "r", {});
    kill(getpid(), SIGKILL);
  });
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_FALSE(IsComplete(target, "r"));
  EXPECT_THAT(Names(dir.path()), ElementsAre("room.partial"));
  StagedFolder(target).Commit("r", {});
  EXPECT_THAT(Names(target), ElementsAre(kManifestName));
}

// The list of files is what does not fit: all else was written.
TEST(StagedFolder, IsNeverWholeWhenTheManifestDoesNotFitOnTheDisk) {
  const TempDir dir;
  const fs::path target = MakeContent(dir, "room");
  WriteManifest(target, "old", {});
  const auto write = [&] {
    const FileSizeLimit limit(1000);
    StagedFolder staged(target);
    for (int i = 0; i < 20; ++i) std::ofstream(staged.path() / std::to_string(i)) << i;
    staged.Commit("new", {});
  };
  EXPECT_THAT(ErrorMessage(write), HasSubstr("manifest.yaml: cannot be written: File too large"));
  EXPECT_TRUE(IsComplete(target, "old"));
  EXPECT_THAT(Names(dir.path()), ElementsAre("room"));
}

}  // namespace
}  // namespace sgf
