#include <sgf/alignment/robust.h>
#include <sgf/alignment/solver.h>

namespace sgf::alignment {

std::span<const std::pair<const char*, RobustKind>> EnumNames(RobustKind) {
  static constexpr std::pair<const char*, RobustKind> kNames[] = {
      {"none", RobustKind::kNone},
      {"huber", RobustKind::kHuber},
      {"student_t", RobustKind::kStudentT}};
  return kNames;
}

std::span<const std::pair<const char*, SolverMethod>> EnumNames(SolverMethod) {
  static constexpr std::pair<const char*, SolverMethod> kNames[] = {
      {"gauss_newton", SolverMethod::kGaussNewton},
      {"levenberg_marquardt", SolverMethod::kLevenbergMarquardt}};
  return kNames;
}

}  // namespace sgf::alignment
