#include <algorithm>

#include <fmt/format.h>

#include <sgf/apps/cli.h>
#include <sgf/apps/sequence_run.h>
#include <sgf/core/error.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/image.h>

namespace sgf::apps {

void SequenceArguments::AddTo(CLI::App& app) {
  app.add_option("sequence", sequence, "FOLDER of the sequence");
  app.add_option("-o,--output", output, "folder for the results (made if missing)");
  app.add_option("--layout", layout,
                 "layout of the sequence: " + options_internal::KnownNames(OdometryLayout{}) +
                     " (default: what the folder looks like)");
  app.add_option("--from", first, "first frame, counted from 0")->capture_default_str();
  app.add_option("--frames", frames, "number of frames (default: all)");
}

OdometrySequence SequenceArguments::Open(const RgbdOptions& rgbd) const {
  if (sequence.empty()) throw Error("", "expected a sequence's folder; see --help");
  if (output.empty()) throw Error("--output", "is missing: name a folder for the results");
  std::optional<OdometryLayout> known;
  if (!layout.empty())
    options_internal::ParseValue(YAML::Node(layout), "layout", "command line", known.emplace());
  return OpenOdometrySequence(sequence, known, rgbd);
}

std::span<const OdometryFrame> SequenceArguments::Chosen(const OdometrySequence& opened) const {
  const int count = static_cast<int>(opened.frames.size());
  if (first < 0 || first >= count)
    throw Error("--from", fmt::format("is {}; the sequence has {} frames", first, count));
  const int wanted = frames.value_or(count);
  if (wanted < 1) throw Error("--frames", fmt::format("is {}; it has to be positive", wanted));
  return std::span(opened.frames).subspan(first, std::min(wanted, count - first));
}

ImageLoader::ImageLoader(const SequenceChange& change, std::int64_t first_ns)
    : change_(change), first_ns_(first_ns) {
  CheckChange(change);
}

cv::Mat1b ImageLoader::operator()(const std::filesystem::path& path, std::int64_t time_ns,
                                  const Camera& camera) {
  cv::Mat1b image = ReadGrey(path);
  if (image.size() != cv::Size(camera.width, camera.height))
    throw Error(path.string(), fmt::format("has {}x{} px, the camera {}x{}", image.cols, image.rows,
                                           camera.width, camera.height));
  if (!ChangesNothing(change_))
    image = ApplyChange(image, ChangeAt(change_, time_ns - first_ns_), 0);
  clipped_ += ClippedShare(image);
  ++images_;
  return image;
}

void EventFile::Write(int frame, std::int64_t time_ns, const std::string& event,
                      const nlohmann::ordered_json& more) {
  nlohmann::ordered_json line = {{"frame", frame}, {"time_ns", time_ns}, {"event", event}};
  line.update(more);
  file_.Write(line.dump() + "\n");
}

bool ReportClock::Due(size_t done, size_t total) {
  const auto now = std::chrono::steady_clock::now();
  if (done < total && now - last_ < std::chrono::seconds(2)) return false;
  last_ = now;
  return true;
}

void WriteRunOptions(const std::filesystem::path& file, const YAML::Node& options) {
  YAML::Node node;
  node["options"] = options;
  node["build"] = DescribeBuild();
  WriteTextFile(file, YAML::Dump(node) + "\n");
}

}  // namespace sgf::apps
