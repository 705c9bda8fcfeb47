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
/// --left-right-max sets left_right_max, --epsilon.scope sets a nested field. The file is a map of
/// options, or the options.yaml of a run (WriteRunOptions()), which has them under `options`.
class OptionFlags {
 public:
  /// @param renamed other flags for some fields, by the field's name.
  /// @param choices what else the tool's options.yaml says of a run, besides options and build.
  template <OptionsStruct O>
  OptionFlags(CLI::App& app, const O& defaults, const std::map<std::string, std::string>& renamed,
              const std::set<std::string>& choices = {})
      : choices_(choices) {
    app.add_option("--config", config_,
                   "YAML file with options, or the options.yaml of a run; flags come on top");
    for (const OptionDoc& doc : DescribeOptions(defaults)) Add(app, doc, renamed);
  }

  /// Names of the options that file and flags set, the outer ones of nested options.
  std::set<std::string> Given() const;

  /// Sets what file and flags say. @throws Error for what they say wrongly.
  template <OptionsStruct O>
  void Apply(O& options) const {
    ReadOptions(LoadConfig().options, options, config_);
    ReadOptions(flags_, options, "command line");
  }

  /// Sets what the file says under one of the choices, if it is that of a run.
  /// @throws Error for what it says wrongly.
  template <class T>
  void ApplyChoice(const std::string& name, T& value) const {
    const YAML::Node choice = LoadConfig().choices[name];
    if (!choice.IsNull()) options_internal::ParseValue(choice, name, config_, value);
  }

 private:
  struct Config {
    YAML::Node options;
    std::map<std::string, YAML::Node> choices;
  };

  void Add(CLI::App& app, const OptionDoc& doc, const std::map<std::string, std::string>& renamed);
  Config LoadConfig() const;

  std::set<std::string> choices_;
  std::string config_;
  YAML::Node flags_{YAML::NodeType::Map};
};

/// Reads a YAML file. @throws Error naming the file, and the line of a syntax error.
YAML::Node LoadYamlFile(const std::string& path);

/// What was built and the instruction set it runs on here, as all tools save it with a run.
YAML::Node DescribeBuild();

}  // namespace sgf::apps
