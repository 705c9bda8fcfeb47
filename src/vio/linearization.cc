#include <algorithm>

#include <sgf/vio/linearization.h>

namespace sgf::vio {

using Eigen::Index, Eigen::Matrix3d, Eigen::MatrixXd;

Linearization::Linearization(std::deque<Frame>& frames, const CalibrationEstimate& calibration,
                             bool calibrates)
    : frames_(frames), calibration_(calibration), calibrates_(calibrates) {
  for (Frame& frame : frames) {
    if (!frame.in_prior) frame.linearization = frame.state;
    blocks_.push_back({frame.id, Part::kPose});
    velocities_.push_back({frame.state.velocity, frame.angular_velocity});
  }
  if (calibrates) blocks_.push_back(kCalibrationBlock);
  visual_blocks_ = blocks_.size();
  for (const Frame& frame : frames)
    if (frame.inertial) blocks_.push_back({frame.id, Part::kMotion});
  Index size = 0;
  for (const BlockId block : blocks_) {
    offsets_.push_back(size);
    size += block.size();
  }
  x_.setZero(size);
  for (const Frame& frame : frames)
    if (frame.in_prior) SetParameters(frame.id, Minus(frame.state, frame.linearization));
  if (calibrates)
    x_.segment<kCalibrationParameters>(OffsetOf(kCalibrationBlock)) =
        Minus(calibration.value, calibration.linearization);
  poses_.resize(frames.size());
  UpdatePoses();
}

Index Linearization::OffsetOf(BlockId block) const {
  return offsets_[std::find(blocks_.begin(), blocks_.end(), block) - blocks_.begin()];
}

int Linearization::PositionOf(int id) const {
  const auto it = std::find_if(frames_.begin(), frames_.end(),
                               [&](const Frame& frame) { return frame.id == id; });
  return static_cast<int>(it - frames_.begin());
}

BodyState Linearization::StateAt(const Frame& frame, const double* pose,
                                 const double* motion) const {
  StateVector delta = StateVector::Zero();
  delta.head<kPoseParameters>() = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(pose);
  if (motion)
    delta.tail<kMotionParameters>() = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(motion);
  return Plus(frame.linearization, delta);
}

BodyState Linearization::StateOf(const Frame& frame) const {
  return StateAt(frame, x_.data() + OffsetOf({frame.id, Part::kPose}),
                 frame.inertial ? x_.data() + OffsetOf({frame.id, Part::kMotion}) : nullptr);
}

Matrix3d Linearization::TurnOf(const Frame& frame, const Eigen::Vector3d& rotation) {
  return frame.in_prior ? Matrix3d::Identity() : RightJacobianSO3(rotation);
}

void Linearization::UpdatePoses() {
  const Calibration now = CalibrationNow();
  for (size_t k = 0; k < frames_.size(); ++k) {
    poses_[k] = PoseAt(k);
    if (!IsSeenElsewhere()) continue;
    poses_[k] = {AsSeen(poses_[k].T_world_body, velocities_[k], now),
                 AsSeen(poses_[k].linearization, velocities_[k], LinearCalibration())};
  }
}

MatrixXd Linearization::JacobianOfPoses() const {
  if (!IsSeenElsewhere()) return {};
  constexpr int n = kPoseParameters;
  MatrixXd J = MatrixXd::Zero(n * static_cast<Index>(frames_.size()), visual_size());
  for (size_t k = 0; k < frames_.size(); ++k) {
    const PoseState pose = PoseAt(k);
    AsSeenJacobian seen = JacobianOfAsSeen(pose.linearization, velocities_[k], LinearCalibration());
    seen.by_pose.leftCols<3>() *= pose.turn;
    const Index at = n * static_cast<Index>(k);
    J.block<n, n>(at, at) = seen.by_pose;
    if (calibrates_)
      J.block<n, kCalibrationParameters>(at, n * frames_.size()) = seen.by_calibration;
  }
  return J;
}

Calibration Linearization::CalibrationNow() const {
  if (!calibrates_) return calibration_.value;
  return Plus(calibration_.linearization,
              x_.segment<kCalibrationParameters>(OffsetOf(kCalibrationBlock)));
}

void Linearization::WriteBack() {
  for (Frame& frame : frames_) {
    const std::int64_t time_ns = frame.state.time_ns;
    frame.state = StateOf(frame);
    frame.state.time_ns = time_ns;
  }
}

PoseState Linearization::PoseAt(size_t k) const {
  const double* pose = x_.data() + offsets_[k];  // poses come first
  const SE3 T = StateAt(frames_[k], pose, nullptr).T_world_body;
  return {T, frames_[k].in_prior ? frames_[k].linearization.T_world_body : T,
          TurnOf(frames_[k], Eigen::Map<const Eigen::Vector3d>(pose))};
}

void Linearization::SetParameters(int id, const StateVector& delta) {
  x_.segment<kPoseParameters>(OffsetOf({id, Part::kPose})) = delta.head<kPoseParameters>();
  if (const BlockId motion{id, Part::kMotion};
      std::find(blocks_.begin(), blocks_.end(), motion) != blocks_.end())
    x_.segment<kMotionParameters>(OffsetOf(motion)) = delta.tail<kMotionParameters>();
}

std::vector<LandmarkItem> ItemsOf(const Linearization& at,
                                  std::map<std::int64_t, Landmark>& landmarks) {
  std::vector<LandmarkItem> items;
  for (auto& [id, landmark] : landmarks) {
    LandmarkItem& item = items.emplace_back();
    item.landmark = &landmark;
    item.host = at.PositionOf(landmark.host);
    for (const LandmarkSight& sight : landmark.sights)
      item.frames.push_back(at.PositionOf(sight.frame));
    item.value << landmark.ray, landmark.inverse_depth;
  }
  return items;
}

}  // namespace sgf::vio
