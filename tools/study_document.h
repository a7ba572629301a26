// A report as blocks, and its two forms: one self-contained page of HTML, and Markdown.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "tools/svg_plot.h"

namespace varve::tools {

struct DocumentCell {
  DocumentCell() = default;
  DocumentCell(std::string what) : text(std::move(what)) {}
  DocumentCell(const char* what) : text(what) {}
  DocumentCell(std::string what, bool is_strong) : text(std::move(what)), strong(is_strong) {}
  std::string text;
  bool strong = false;
};

struct DocumentHeading {
  int level = 1;
  std::string text;
};
struct DocumentText {
  std::string text;
};
struct DocumentTable {
  std::vector<std::string> header;
  std::vector<std::vector<DocumentCell>> rows;
};
struct DocumentPlot {
  std::string name;  ///< of its file beside Markdown, without ending
  Plot plot;
};
using DocumentBlock =
    std::variant<DocumentHeading, DocumentText, DocumentTable, DocumentPlot>;

struct Document {
  std::string title;
  std::vector<DocumentBlock> blocks;

  void heading(int level, std::string text) { blocks.push_back(DocumentHeading{level, text}); }
  void text(std::string text) { blocks.push_back(DocumentText{std::move(text)}); }
  void table(DocumentTable table) {
    if (!table.rows.empty()) blocks.push_back(std::move(table));
  }
  void plot(std::string name, Plot plot) {
    if (!plot.empty()) blocks.push_back(DocumentPlot{std::move(name), std::move(plot)});
  }
};

/// Style and plots are in the page; it loads nothing.
std::string html_of(const Document& document);

/// Plots become links to `plots`/NAME.svg; with `plots` empty they are left out.
std::string markdown_of(const Document& document, const std::string& plots);

}  // namespace varve::tools
