"""Results become numbers, pictures and pages: terminal tables, JUnit XML, and one HTML file with figures and replays."""
