"""One self-contained HTML file that shows a run: moving picture, lines against time, numbers, its case.

Depends on: picture, plot, export; works on the dataset of a run.
"""

from cablesim.report.page import report_html as report_html
from cablesim.report.page import write_report as write_report
