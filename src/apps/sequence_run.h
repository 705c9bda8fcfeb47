#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>
#include <yaml-cpp/yaml.h>

#include <sgf/apps/sequence_change.h>
#include <sgf/core/options.h>
#include <sgf/io/odometry_dataset.h>

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

/// Says when to report: every two seconds, and at the end.
class ReportClock {
 public:
  bool Due(size_t done, size_t total);

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Writes options.yaml: all options of a run, as written by WriteOptions(), and the build.
void WriteRunOptions(const std::filesystem::path& file, const YAML::Node& options);

}  // namespace sgf::apps
