#include <atomic>
#include <vector>

#include <gtest/gtest.h>

#include <sgf/core/error.h>
#include <sgf/core/parallel.h>

namespace sgf {
namespace {

TEST(Parallel, CallsEveryIndexOnceForAnyThreadCount) {
  for (const int threads : {0, 1, 2, 7}) {
    std::vector<std::atomic<int>> calls(101);
    ParallelFor(101, threads, [&](int i) { ++calls[i]; });
    for (const auto& count : calls) EXPECT_EQ(count, 1);
  }
}

TEST(Parallel, DoesNothingForNoWork) {
  ParallelFor(0, 2, [](int) { FAIL() << "called for no work"; });
}

TEST(Parallel, PassesExceptionsOn) {
  EXPECT_THROW(ParallelFor(8, 2,
                           [](int i) {
                             if (i == 5) throw Error("body", "five");
                           }),
               Error);
}

TEST(Parallel, RejectsNegativeThreadCounts) { EXPECT_THROW(ResolveThreads(-1), Error); }

}  // namespace
}  // namespace sgf
