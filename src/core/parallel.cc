#include <fmt/core.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>

namespace sgf {

int ResolveThreads(int requested) {
  if (requested < 0) throw Error("threads", fmt::format("must not be negative, got {}", requested));
  return requested == 0 ? tbb::this_task_arena::max_concurrency() : requested;
}

void ParallelFor(int count, int threads, const std::function<void(int)>& body) {
  const int n = ResolveThreads(threads);
  if (n == 1 || count <= 1) {
    for (int i = 0; i < count; ++i) body(i);
    return;
  }
  const auto run = [&] { tbb::parallel_for(0, count, body, tbb::simple_partitioner()); };
  // The caller's arena has its workers awake; another one is for fewer threads only.
  if (n >= tbb::this_task_arena::max_concurrency())
    run();
  else
    tbb::task_arena(n).execute(run);
}

}  // namespace sgf
