#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <yaml-cpp/yaml.h>

#include <sgf/apps/sequence_change.h>
#include <sgf/core/options.h>
#include <sgf/io/atomic_file.h>
#include <sgf/io/odometry_dataset.h>
#include <sgf/io/ply.h>

/// What the tools share that run an odometry over a sequence.
namespace sgf::apps {

/// Which sequence, which of its frames, and where results go.
struct SequenceArguments {
  std::string sequence;
  std::string output;
  std::string layout;
  int first = 0;
  std::optional<int> frames;

  void AddTo(CLI::App& app);

  /// @throws Error where the folder of the sequence or of the results is not named, and as
  ///   OpenOdometrySequence().
  OdometrySequence Open(const RgbdOptions& rgbd) const;

  /// The frames asked for, no more than there are.
  /// @throws Error for a first frame that is none, or a number that is not positive.
  std::span<const OdometryFrame> Chosen(const OdometrySequence& opened) const;
};

/// Reads the images of a sequence and puts a change of light on them.
class ImageLoader {
 public:
  /// @param first_ns time of the sequence's first frame, from which the change counts.
  /// @throws Error as CheckChange().
  ImageLoader(const SequenceChange& change, std::int64_t first_ns);

  /// @throws Error as ReadGrey(), and for an image that is not of the camera's size.
  cv::Mat1b operator()(const std::filesystem::path& path, std::int64_t time_ns,
                       const Camera& camera);

  /// Share of the pixels so far that have no room above.
  double clipped_share() const { return images_ > 0 ? clipped_ / images_ : 0; }

 private:
  SequenceChange change_;
  std::int64_t first_ns_;
  double clipped_ = 0;
  int images_ = 0;
};

/// A line of JSON for everything that happens in a run, written as it happens.
class EventFile {
 public:
  /// @throws Error for a file that cannot be made.
  explicit EventFile(const std::filesystem::path& file) : file_(file) {}

  /// Writes frame, time_ns, event and what `more` has. @throws Error for a line that cannot be
  /// written.
  void Write(int frame, std::int64_t time_ns, const std::string& event,
             const nlohmann::ordered_json& more);

  /// Gives the file its name. @throws Error where that fails.
  void Close() { file_.Commit(); }

 private:
  AtomicFile file_;
};

/// A point of a map as PLY files have it; its variance is that of the inverse depth over its
/// square.
/// @param point with position, inverse depth, its variance, grey and support.
template <class Point>
PlyPoint ToPly(const Point& point) {
  const Eigen::Vector3f p = point.position.template cast<float>();
  const double relative =
      point.inverse_depth_variance / (point.inverse_depth * point.inverse_depth);
  return {{p.x(), p.y(), p.z()}, point.grey, static_cast<float>(relative), point.support};
}

/// Says when to report: every two seconds, and at the end.
class ReportClock {
 public:
  bool Due(size_t done, size_t total);

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Writes options.yaml: all options of a run, as written by WriteOptions(), and the build. --config
/// takes the file (OptionFlags).
void WriteRunOptions(const std::filesystem::path& file, const YAML::Node& options);

}  // namespace sgf::apps
