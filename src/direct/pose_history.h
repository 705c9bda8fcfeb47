#pragma once

#include <cstdint>
#include <vector>

#include <sgf/core/se3.h>
#include <sgf/direct/frame.h>

namespace sgf::direct {

/// Poses of all frames so far, each as it lies to a key-frame: they follow when it is refined.
class PoseHistory {
 public:
  /// A frame with a pose.
  struct Record {
    std::int64_t time_ns = 0;
    int segment = 0;
    int keyframe = 0;  ///< id
    SE3 T_cam_keyframe;
  };

  const std::vector<Record>& records() const { return records_; }

  /// Key-frames are numbered from 0, those that left the window as well.
  int keyframes() const { return static_cast<int>(keyframe_poses_.size()); }
  const SE3& KeyframePose(int id) const { return keyframe_poses_.at(id); }

  /// T_cam_world of a frame, as it is known now.
  SE3 PoseOf(const Record& record) const {
    return record.T_cam_keyframe * KeyframePose(record.keyframe);
  }
  SE3 LastPose() const { return PoseOf(records_.back()); }

  void Add(const Record& record) { records_.push_back(record); }

  /// @return its id.
  int AddKeyframe(const SE3& T_cam_world);

  /// The last frame has become this key-frame.
  void MakeLastKeyframe(int id);

  /// Takes on the poses of a window's key-frames.
  void Update(const Window& window);

  /// Forgets key-frames from a number on, none of which has frames.
  void ForgetKeyframes(int from) { keyframe_poses_.resize(from); }

 private:
  std::vector<Record> records_;
  std::vector<SE3> keyframe_poses_;  ///< T_cam_world by id
};

}  // namespace sgf::direct
