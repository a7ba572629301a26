#include "tools/study_document.h"

#include <fmt/format.h>

namespace varve::tools {
namespace {

constexpr const char* style = R"(<style>
body { font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222;
       background: #fff; line-height: 1.4; }
table { border-collapse: collapse; margin: 0.8em 0 1.4em; font-size: 0.92em; display: block;
        overflow-x: auto; }
th, td { border-bottom: 1px solid #ccc; padding: 0.25em 0.7em; text-align: left;
         vertical-align: top; }
th { background: #f2f4f6; }
h2 { margin-top: 2em; border-bottom: 2px solid #1b6ca8; }
svg { max-width: 100%; height: auto; }
</style>
)";

class Html {
 public:
  std::string out;
  void operator()(const DocumentHeading& heading) {
    out += fmt::format("<h{0}>{1}</h{0}>\n", heading.level, escape_markup(heading.text));
  }
  void operator()(const DocumentText& text) {
    out += fmt::format("<p>{}</p>\n", escape_markup(text.text));
  }
  void operator()(const DocumentTable& table) {
    out += "<table>\n<tr>";
    for (const std::string& each : table.header)
      out += fmt::format("<th>{}</th>", escape_markup(each));
    out += "</tr>\n";
    for (const auto& row : table.rows) {
      out += "<tr>";
      for (const DocumentCell& cell : row)
        out += cell.strong ? fmt::format("<td><b>{}</b></td>", escape_markup(cell.text))
                           : fmt::format("<td>{}</td>", escape_markup(cell.text));
      out += "</tr>\n";
    }
    out += "</table>\n";
  }
  void operator()(const DocumentPlot& plot) {
    out += fmt::format("<figure>\n{}</figure>\n", svg_of(plot.plot));
  }
};

/// What Markdown would take for markup, or for the end of a cell.
std::string escape_markdown(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '|' || c == '*' || c == '_' || c == '`' || c == '<') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out;
}

class Markdown {
 public:
  explicit Markdown(std::string plots) : plots_(std::move(plots)) {}
  std::string out;
  void operator()(const DocumentHeading& heading) {
    out += fmt::format("{} {}\n\n", std::string(static_cast<std::size_t>(heading.level), '#'),
                       escape_markdown(heading.text));
  }
  void operator()(const DocumentText& text) { out += escape_markdown(text.text) + "\n\n"; }
  void operator()(const DocumentTable& table) {
    std::string rule;
    for (const std::string& each : table.header) {
      out += fmt::format("| {} ", escape_markdown(each));
      rule += "|---";
    }
    out += "|\n" + rule + "|\n";
    for (const auto& row : table.rows) {
      for (const DocumentCell& cell : row) {
        const std::string text = escape_markdown(cell.text);
        out += cell.strong && !text.empty() ? fmt::format("| **{}** ", text)
                                            : fmt::format("| {} ", text);
      }
      out += "|\n";
    }
    out += "\n";
  }
  void operator()(const DocumentPlot& plot) {
    if (!plots_.empty())
      out += fmt::format("![{}]({}/{}.svg)\n\n", escape_markdown(plot.plot.title), plots_,
                         plot.name);
  }

 private:
  std::string plots_;
};

}  // namespace

std::string html_of(const Document& document) {
  Html html;
  html.out = fmt::format("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
                         "<title>{0}</title>\n{1}</head>\n<body>\n<h1>{0}</h1>\n",
                         escape_markup(document.title), style);
  for (const DocumentBlock& block : document.blocks) std::visit(html, block);
  return html.out + "</body>\n</html>\n";
}

std::string markdown_of(const Document& document, const std::string& plots) {
  Markdown markdown(plots);
  markdown.out = fmt::format("# {}\n\n", escape_markdown(document.title));
  for (const DocumentBlock& block : document.blocks) std::visit(markdown, block);
  while (markdown.out.ends_with("\n\n")) markdown.out.pop_back();
  return markdown.out;
}

}  // namespace varve::tools
