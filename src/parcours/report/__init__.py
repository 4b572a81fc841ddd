"""Reports: tables, charts and pages, for the terminal, for build servers, and as one HTML file."""
