#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>

namespace sgf {
namespace {

// Unique in this machine's running processes and within this one.
std::filesystem::path TemporaryName(const std::filesystem::path& target) {
  static std::atomic<int> counter{0};
  auto name = target;
  name += fmt::format(".tmp-{}-{}", getpid(), counter++);
  return name;
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target)
    : target_(std::move(target)), temporary_(TemporaryName(target_)) {
  // Not mkstemp(): the result is to have the permissions of an ordinary file. A leftover of a
  // killed process with our id is overwritten.
  descriptor_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0) Fail("cannot be created", errno);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) close(descriptor_);
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(temporary_, ignored);
}

void AtomicFile::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(descriptor_, bytes.data(), bytes.size());
    if (written >= 0)
      bytes.remove_prefix(static_cast<size_t>(written));
    else if (errno != EINTR)
      Fail("cannot be written", errno);
  }
}

void AtomicFile::Overwrite(std::int64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(descriptor_, bytes.data(), bytes.size(), offset);
    if (written >= 0) {
      bytes.remove_prefix(static_cast<size_t>(written));
      offset += written;
    } else if (errno != EINTR) {
      Fail("cannot be written", errno);
    }
  }
}

void AtomicFile::Commit() {
  Close();
  std::error_code error;
  std::filesystem::rename(temporary_, target_, error);
  if (error) Fail("cannot be written", error.value());
  committed_ = true;
}

// Some file systems report a full disk only here.
void AtomicFile::Close() {
  const int failed = close(descriptor_);
  descriptor_ = -1;
  if (failed != 0) Fail("cannot be written", errno);
}

void AtomicFile::Fail(const char* what, int error_number) const {
  throw Error(target_.string(),
              fmt::format("{}: {}", what, std::generic_category().message(error_number)));
}

void WriteTextFile(const std::filesystem::path& path, std::string_view text) {
  AtomicFile file(path);
  file.Write(text);
  file.Commit();
}

void MakeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw Error(folder.string(), "cannot be made: " + error.message());
}

}  // namespace sgf
