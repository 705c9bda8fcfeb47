#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/core.h>

#include <sgf/core/error.h>
#include <sgf/direct/prior.h>

namespace sgf::direct {

using Eigen::MatrixXd, Eigen::VectorXd;

void Prior::AddFrame(int id) {
  if (std::find(frames_.begin(), frames_.end(), id) != frames_.end()) return;
  frames_.push_back(id);
  const Eigen::Index before = b_.size(), after = before + kFrameParameters;
  H_.conservativeResizeLike(MatrixXd::Zero(after, after));
  b_.conservativeResizeLike(VectorXd::Zero(after));
}

int Prior::OffsetOf(int id) const {
  const auto it = std::find(frames_.begin(), frames_.end(), id);
  if (it == frames_.end()) throw Error("prior", fmt::format("has no key-frame {}", id));
  return kFrameParameters * static_cast<int>(it - frames_.begin());
}

void Prior::Add(const std::vector<int>& ids, const MatrixXd& H, const VectorXd& b) {
  for (int id : ids) AddFrame(id);
  constexpr int n = kFrameParameters;
  for (size_t i = 0; i < ids.size(); ++i) {
    const int row = OffsetOf(ids[i]), from_row = n * static_cast<int>(i);
    b_.segment<n>(row) += b.segment<n>(from_row);
    for (size_t j = 0; j < ids.size(); ++j)
      H_.block<n, n>(row, OffsetOf(ids[j])) +=
          H.block<n, n>(from_row, n * static_cast<Eigen::Index>(j));
  }
}

void Prior::Marginalize(int id) {
  constexpr int n = kFrameParameters;
  const Eigen::Index at = OffsetOf(id), size = b_.size(), after = size - at - n;
  // The key-frame's parameters last.
  Eigen::PermutationMatrix<Eigen::Dynamic> last(size);
  for (Eigen::Index k = 0; k < size; ++k)
    last.indices()[k] = static_cast<int>(k < at ? k : (k < at + n ? k + after : k - n));
  const MatrixXd H = last * H_ * last.transpose();
  const VectorXd b = last * b_;
  const Eigen::Index rest = size - n;
  // Parameters have units of their own: scaled to a diagonal of about 1 before the inverse.
  const FrameParameters unit =
      (H.bottomRightCorner<n, n>().diagonal().array() + 1e-10).rsqrt().matrix();
  Eigen::Matrix<double, n, n> block =
      unit.asDiagonal() * H.bottomRightCorner<n, n>() * unit.asDiagonal();
  block.diagonal().array() += 1e-9;
  const Eigen::LDLT<Eigen::Matrix<double, n, n>> solver(block);
  const MatrixXd across = unit.asDiagonal() * H.bottomLeftCorner(n, rest);
  H_ = H.topLeftCorner(rest, rest) - across.transpose() * solver.solve(across);
  H_ = (0.5 * (H_ + H_.transpose())).eval();
  b_ = b.head(rest) - across.transpose() * solver.solve(unit.cwiseProduct(b.tail<n>()));
  std::erase(frames_, id);
}

}  // namespace sgf::direct
