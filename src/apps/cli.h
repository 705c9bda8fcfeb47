#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>

#include <CLI/CLI.hpp>

#include <sgf/core/options.h>

namespace sgf::apps {

/// Parses the command line and runs `body`. Bad input or a bad command line prints one line to
/// stderr and ends with exit code 2, anything unforeseen with 1.
int RunTool(CLI::App& app, int argc, char** argv, const std::function<void()>& body);

/// Command-line flags for all fields of an options struct, after a file given with --config:
/// --left-right-max sets left_right_max, --epsilon.scope sets a nested field.
class OptionFlags {
 public:
  /// @param renamed other flags for some fields, by the field's name.
  template <OptionsStruct O>
  OptionFlags(CLI::App& app, const O& defaults, const std::map<std::string, std::string>& renamed) {
    app.add_option("--config", config_, "YAML file with options; flags come on top");
    for (const OptionDoc& doc : DescribeOptions(defaults)) Add(app, doc, renamed);
  }

  /// Names of the options that file and flags set, the outer ones of nested options.
  std::set<std::string> Given() const;

  /// Sets what file and flags say. @throws Error for what they say wrongly.
  template <OptionsStruct O>
  void Apply(O& options) const {
    if (!config_.empty()) ReadOptions(LoadConfig(), options, config_);
    ReadOptions(flags_, options, "command line");
  }

 private:
  void Add(CLI::App& app, const OptionDoc& doc, const std::map<std::string, std::string>& renamed);
  YAML::Node LoadConfig() const;

  std::string config_;
  YAML::Node flags_{YAML::NodeType::Map};
};

/// Reads a YAML file. @throws Error naming the file, and the line of a syntax error.
YAML::Node LoadYamlFile(const std::string& path);

/// What was built and the instruction set it runs on here, as all tools save it with a run.
YAML::Node DescribeBuild();

}  // namespace sgf::apps
