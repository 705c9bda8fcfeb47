#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/core/error.h>
#include <sgf/metrics/registry.h>

namespace sgf::metrics {
namespace {

TEST(Registry, NamesEveryDissimilarityOnce) {
  std::vector<std::string_view> names;
  std::set<std::string_view> unique;
  size_t aliases = 0;
  for (const MetricInfo& info : AllMetrics()) {
    names.push_back(info.name);
    unique.insert(info.name);
    if (!info.alias.empty()) {
      unique.insert(info.alias);
      ++aliases;
    }
    EXPECT_FALSE(info.formula.empty()) << info.name;
    EXPECT_FALSE(info.equation.empty()) << info.name;
  }
  EXPECT_THAT(names, ::testing::ElementsAre("photo", "sad", "gm", "agm", "gn", "pm", "gom", "ngf",
                                            "ugf", "sgf", "sgf2", "sgf3", "ngv", "sgv", "sgf3_vec",
                                            "ncc", "zncc", "census", "lssd"));
  EXPECT_EQ(unique.size(), names.size() + aliases);
}

TEST(Registry, FindsNamesAndAliases) {
  for (const MetricInfo& info : AllMetrics()) EXPECT_EQ(FindMetric(info.name).name, info.name);
  EXPECT_EQ(FindMetric("mag").name, "agm");
  EXPECT_EQ(FindMetric("sgf").equation, "10");
  EXPECT_TRUE(FindMetric("zncc").traits.windowed());
}

TEST(Registry, ListsTheKnownNamesForAnUnknownOne) {
  for (const std::string unknown : {"sfg", "", "SGF"}) {
    try {
      FindMetric(unknown);
      FAIL() << "found '" << unknown << "'";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(),
                  ::testing::StartsWith("metric: '" + unknown + "' is unknown; known: "));
      EXPECT_THAT(error.what(), ::testing::HasSubstr("agm (or mag)"));
      for (const MetricInfo& info : AllMetrics())
        EXPECT_THAT(error.what(), ::testing::HasSubstr(std::string(info.name)));
    }
  }
}

TEST(Registry, VisitsTheTypeOfTheName) {
  const auto name_of = [](const auto& metric) { return metric.kInfo.name; };
  for (const MetricInfo& info : AllMetrics()) EXPECT_EQ(VisitMetric(info.name, name_of), info.name);
  EXPECT_EQ(VisitMetric("mag", name_of), "agm");
  EXPECT_EQ(
      VisitMetric("pm",
                  [](const auto& metric) { return std::is_same_v<decltype(metric), const Pm&>; }),
      true);
  EXPECT_THROW(VisitMetric("sfg", name_of), Error);
}

}  // namespace
}  // namespace sgf::metrics
