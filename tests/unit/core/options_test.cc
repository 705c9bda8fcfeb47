#include <limits>
#include <string>
#include <vector>

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

struct Item {
  std::string name;
  double to_s = std::numeric_limits<double>::infinity();
  template <class V>
  void VisitFields(V&& visit) {
    visit("name", name, "", "a name");
    visit("to_s", to_s, "s", "an end");
  }
};

struct Outer {
  int window = 9;
  GradientOperator gradient = GradientOperator::kCentral;
  std::vector<int> sizes = {1, 2};
  Inner inner;
  std::vector<Item> items;
  template <class V>
  void VisitFields(V&& visit) {
    visit("window", window, "px", "side");
    visit("gradient", gradient, "", "operator");
    visit("sizes", sizes, "px", "some sizes");
    visit("inner", inner, "", "nested");
    visit("items", items, "", "a list");
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
  ASSERT_EQ(docs.size(), 7U);
  EXPECT_EQ(docs[0].name, "window");
  EXPECT_EQ(docs[0].default_value, "9");
  EXPECT_EQ(docs[0].unit, "px");
  EXPECT_EQ(docs[2].default_value, "[1, 2]");
  EXPECT_EQ(docs[3].name, "inner.ratio");
  EXPECT_EQ(docs[4].name, "items");
  EXPECT_EQ(docs[4].default_value, "[]");
  EXPECT_EQ(docs[5].name, "items[].name");
  EXPECT_EQ(docs[6].name, "items[].to_s");
  EXPECT_EQ(docs[6].default_value, ".inf");
  EXPECT_EQ(docs[6].unit, "s");
}

TEST(Options, ReadsAListOfOptionsInPlaceOfTheOldOne) {
  Outer options;
  options.items.resize(3);
  ReadOptions(YAML::Load("items: [{name: a, to_s: 2}, {name: b}]"), options, "run.yaml");
  ASSERT_EQ(options.items.size(), 2U);
  EXPECT_EQ(options.items[0].name, "a");
  EXPECT_EQ(options.items[0].to_s, 2);
  EXPECT_EQ(options.items[1].name, "b");
  EXPECT_EQ(options.items[1].to_s, Item().to_s);
}

TEST(Options, WritesAListOfOptionsAsItReadsIt) {
  Outer options;
  options.items = {{"a", 2}, {"b", Item().to_s}};
  Outer copy;
  ReadOptions(YAML::Load(YAML::Dump(WriteOptions(options))), copy, "copy");
  ASSERT_EQ(copy.items.size(), 2U);
  EXPECT_EQ(copy.items[0].name, "a");
  EXPECT_EQ(copy.items[0].to_s, 2);
  EXPECT_EQ(copy.items[1].to_s, Item().to_s);
  EXPECT_EQ(DescribeOptions(options)[4].default_value,
            "[{name: a, to_s: 2}, {name: b, to_s: .inf}]");
}

TEST(Options, ReadsListsThatFlagsGiveAsText) {
  const auto sizes = [](const std::string& text) {
    Outer options;
    YAML::Node flags(YAML::NodeType::Map);
    SetOption(flags, "sizes", text);
    ReadOptions(flags, options, "command line");
    return options.sizes;
  };
  using List = std::vector<int>;
  EXPECT_EQ(sizes("3,4,5"), (List{3, 4, 5}));
  EXPECT_EQ(sizes(" [3 , 4] "), (List{3, 4}));
  EXPECT_EQ(sizes("3"), List{3});
  EXPECT_EQ(sizes("[]"), List{});
  EXPECT_EQ(sizes(""), List{});
  for (const char* bad : {"3,", "3;4", "[3", "3]", "[[3]]", "a"})
    EXPECT_THROW(sizes(bad), Error) << bad;
}

TEST(Options, NamesTheLineOfWhatIsWrongInAList) {
  EXPECT_EQ(MessageOf("items:\n  - name: a\n  - nam: b"), "run.yaml:3: unknown key 'nam'");
  EXPECT_EQ(MessageOf("items:\n  - to_s: late"),
            "run.yaml:2: cannot read 'late' as the value of to_s");
  EXPECT_EQ(MessageOf("window: 3\nitems: a"), "run.yaml:2: items has to be a list");
  EXPECT_EQ(MessageOf("items:\n  - a"), "run.yaml:2: expected a map of options in items");
}

}  // namespace
}  // namespace sgf
