#include <iterator>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/read_file.h>

#include "support/error_message.h"
#include "support/temp_dir.h"

namespace sgf {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> FileNames(const TempDir& dir) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(dir.path()))
    names.push_back(entry.path().filename().string());
  return names;
}

// Writes beyond this many bytes of a file fail with EFBIG while it lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_handler_(signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limited{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    signal(SIGXFSZ, old_handler_);
  }

 private:
  rlimit old_{};
  sighandler_t old_handler_;
};

TEST(AtomicFile, AppearsWhenCommittedAndNotBefore) {
  const TempDir dir;
  const auto path = dir.File("table.csv");
  AtomicFile file(path);
  file.Write("a,");
  file.Write("b\n");
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_EQ(FileNames(dir).size(), 1U) << "the temporary file is to lie in the target's folder";
  file.Commit();
  EXPECT_EQ(ReadFile(path), "a,b\n");
  EXPECT_THAT(FileNames(dir), ElementsAre("table.csv"));
}

TEST(AtomicFile, LeavesTheOldFileUnlessCommitted) {
  const TempDir dir;
  const auto path = dir.Write("table.csv", "old");
  { AtomicFile(path).Write("new"); }
  EXPECT_EQ(ReadFile(path), "old");
  EXPECT_THAT(FileNames(dir), ElementsAre("table.csv"));
}

TEST(AtomicFile, ReplacesTheOldFile) {
  const TempDir dir;
  const auto path = dir.Write("table.csv", "something longer");
  AtomicFile file(path);
  file.Write("new");
  file.Commit();
  EXPECT_EQ(ReadFile(path), "new");
}

TEST(AtomicFile, KeepsTwoWritersOfOneTargetApart) {
  const TempDir dir;
  const auto path = dir.File("table.csv");
  AtomicFile first(path);
  AtomicFile second(path);
  first.Write("first");
  second.Write("second");
  second.Commit();
  first.Commit();
  EXPECT_EQ(ReadFile(path), "first");
}

TEST(AtomicFile, HasThePermissionsOfAnOrdinaryFile) {
  const TempDir dir;
  const auto ordinary = dir.Write("ordinary", "");
  AtomicFile file(dir.File("atomic"));
  file.Commit();
  EXPECT_EQ(std::filesystem::status(dir.File("atomic")).permissions(),
            std::filesystem::status(ordinary).permissions());
}

TEST(AtomicFile, NamesTheTargetWhoseFolderIsMissing) {
  const TempDir dir;
  const auto path = dir.path() / "missing" / "table.csv";
  EXPECT_EQ(ErrorMessage([&] { AtomicFile file(path); }),
            path.string() + ": cannot be created: No such file or directory");
}

TEST(AtomicFile, ReportsATargetThatIsAFolderAndCleansUp) {
  const TempDir dir;
  const auto path = dir.File("folder/file").parent_path();
  EXPECT_THAT(ErrorMessage([&] { AtomicFile(path).Commit(); }), HasSubstr("cannot be written"));
  EXPECT_THAT(FileNames(dir), ElementsAre("folder"));
}

TEST(AtomicFile, ReportsAFullDiskAndCleansUp) {
  const TempDir dir;
  const auto path = dir.File("large");
  {
    const FileSizeLimit limit(1000);
    EXPECT_EQ(ErrorMessage([&] { AtomicFile(path).Write(std::string(2000, 'x')); }),
              path.string() + ": cannot be written: File too large");
  }
  EXPECT_THAT(FileNames(dir), IsEmpty());
}

}  // namespace
}  // namespace sgf
