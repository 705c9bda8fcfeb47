#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sgf/core/gradient.h>
#include <sgf/core/options.h>

namespace sgf {
namespace {

struct Inner {
  double ratio = 0.5;
  template <class V>
  void VisitFields(V&& visit) {
    visit("ratio", ratio, "", "an inner number");
  }
};

struct Outer {
  int window = 9;
  GradientOperator gradient = GradientOperator::kCentral;
  std::vector<int> sizes = {1, 2};
  Inner inner;
  template <class V>
  void VisitFields(V&& visit) {
    visit("window", window, "px", "side");
    visit("gradient", gradient, "", "operator");
    visit("sizes", sizes, "px", "some sizes");
    visit("inner", inner, "", "nested");
  }
};

std::string MessageOf(const std::string& yaml) {
  Outer options;
  try {
    ReadOptions(YAML::Load(yaml), options, "run.yaml");
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Options, ReadsTheNamedFieldsAndKeepsTheOthers) {
  Outer options;
  ReadOptions(YAML::Load("{gradient: scharr, sizes: [3], inner: {ratio: 2}}"), options, "run.yaml");
  EXPECT_EQ(options.window, 9);
  EXPECT_EQ(options.gradient, GradientOperator::kScharr);
  EXPECT_THAT(options.sizes, ::testing::ElementsAre(3));
  EXPECT_EQ(options.inner.ratio, 2);
}

TEST(Options, WritesWhatItReads) {
  Outer options;
  options.window = 21;
  options.gradient = GradientOperator::kScharr;
  options.inner.ratio = 0.1;
  Outer copy;
  ReadOptions(WriteOptions(options), copy, "copy");
  EXPECT_EQ(copy.window, 21);
  EXPECT_EQ(copy.gradient, GradientOperator::kScharr);
  EXPECT_EQ(copy.inner.ratio, 0.1);
}

TEST(Options, NamesFileLineAndKeyOfWhatIsWrong) {
  EXPECT_EQ(MessageOf("window: 3\nwindwo: 4"), "run.yaml:2: unknown key 'windwo'");
  EXPECT_EQ(MessageOf("window: 3\ninner:\n  rato: 4"), "run.yaml:3: unknown key 'rato'");
  EXPECT_EQ(MessageOf("? [a]\n: 4"), "run.yaml:1: unknown key '[a]'");
  EXPECT_EQ(MessageOf("window: wide"), "run.yaml:1: cannot read 'wide' as the value of window");
  EXPECT_EQ(MessageOf("gradient: sobel"),
            "run.yaml:1: gradient is 'sobel'; known: central, scharr");
  EXPECT_EQ(MessageOf("[1, 2]"), "run.yaml:1: expected a map of options");
}

TEST(Options, DescribesEveryFieldWithDefaultUnitAndText) {
  const auto docs = DescribeOptions(Outer{});
  ASSERT_EQ(docs.size(), 4U);
  EXPECT_EQ(docs[0].name, "window");
  EXPECT_EQ(docs[0].default_value, "9");
  EXPECT_EQ(docs[0].unit, "px");
  EXPECT_EQ(docs[2].default_value, "[1, 2]");
  EXPECT_EQ(docs[3].name, "inner.ratio");
}

}  // namespace
}  // namespace sgf
