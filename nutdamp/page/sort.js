"use strict";
// Lets every table of class "sortable" be sorted by the buttons that this puts into its headings.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const heads = Array.from(table.tHead.rows[0].cells);
  if (body.rows.length < 2) continue;
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "Sort by this column";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const falling = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", falling ? "descending" : "ascending");
      const rows = Array.from(body.rows, (row) => {
        const cell = row.cells[column];
        // A cell that shows "< 1e-9" has its number beside it.
        const value = Number(cell.dataset.value ?? (cell.textContent || NaN));
        return { row, known: cell.classList.contains("number") && !Number.isNaN(value), value, text: cell.textContent };
      });
      // Numbers before words, and what is not known last, whichever way.
      rows.sort((one, other) => {
        if (one.known !== other.known) return one.known ? -1 : 1;
        const order = one.known ? one.value - other.value : one.text.localeCompare(other.text);
        return falling ? -order : order;
      });
      body.append(...rows.map((entry) => entry.row));
    });
  });
}
