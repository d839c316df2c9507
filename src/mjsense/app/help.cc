// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/help.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>

#include "mjsense/app/terminal.h"

namespace mjsense::app {
namespace {

constexpr std::size_t kNameColumn = 28;  // where descriptions begin
constexpr std::size_t kMaxWidth = 100;   // longer lines are hard to read

class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() : width_(std::clamp(terminal_width(STDOUT_FILENO), std::size_t{40}, kMaxWidth)) {
    label("Positionals", "Arguments");
    label("Subcommands", "Commands");
    label("SUBCOMMAND", "COMMAND");
  }

  std::string make_description(const CLI::App* app) const override {
    return paragraph(app->get_description());
  }

  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string name = make_option_name(option, is_positional);
    if (!option->get_type_name().empty() && option->get_items_expected_max() > 0)
      name += " " + option->get_type_name();
    std::string text = option->get_description();
    if (option->get_required()) text += " Required.";
    if (!option->get_default_str().empty())
      text += fmt::format(" (default: {})", option->get_default_str());
    return entry(name, text);
  }

  std::string make_subcommand(const CLI::App* sub) const override {
    return entry(sub->get_name(), sub->get_description());
  }

  std::string make_footer(const CLI::App* app) const override {
    const std::string footer = app->get_footer();
    return footer.empty() ? "" : footer + "\n";
  }

 private:
  std::string paragraph(const std::string& text) const {
    std::string out;
    for (const std::string& line : wrap(text, width_)) out += line + "\n";
    return out + "\n";
  }

  std::string entry(const std::string& name, const std::string& text) const {
    std::string out = "  " + name;
    bool begun = display_width(out) + 2 > kNameColumn;  // the description begins on the next line
    if (begun) out += "\n";
    for (const std::string& line : wrap(text, std::max(width_ - kNameColumn, std::size_t{24}))) {
      out += std::string(begun ? kNameColumn : kNameColumn - display_width(out), ' ') + line + "\n";
      begun = true;
    }
    return out;
  }

  std::size_t width_;
};

}  // namespace

void set_help_format(CLI::App& program) {
  program.formatter(std::make_shared<HelpFormatter>());
  program.set_help_flag("-h,--help", "Print this help and exit.");
}

void add_examples(CLI::App& app, const std::vector<Example>& examples) {
  std::string text = "Examples:";
  for (const auto& [command, explanation] : examples)
    text += fmt::format("\n  # {}\n  {}", explanation, command);
  app.footer(text);
}

}  // namespace mjsense::app
