#include <sgf/direct/pose_history.h>

namespace sgf::direct {

int PoseHistory::AddKeyframe(const SE3& T_cam_world) {
  keyframe_poses_.push_back(T_cam_world);
  return keyframes() - 1;
}

void PoseHistory::MakeLastKeyframe(int id) {
  records_.back().keyframe = id;
  records_.back().T_cam_keyframe = {};
}

void PoseHistory::Update(const Window& window) {
  for (const auto& frame : window) keyframe_poses_[frame->id] = frame->T_cam_world;
}

}  // namespace sgf::direct
