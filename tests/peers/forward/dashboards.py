"""The queries of the Grafana dashboards, as Grafana sends them."""
import json, re

from servers import ROOT

FILES = sorted((ROOT / "config/grafana").glob("*.json"))


def panels(file):
    """Each panel of a dashboard with its query."""
    for panel in json.loads(file.read_text())["panels"]:
        for target in panel.get("targets", []):
            yield panel, target["rawSql"]


def written_out(sql, span, site, press):
    """A query over the last `span` of a press, its macros and variables filled in."""
    sql = re.sub(r"\$__timeFilter\((.*?)\)", rf"\1 BETWEEN now() - interval '{span}' AND now()", sql)
    sql = sql.replace("$__timeFrom()", f"(now() - interval '{span}')").replace("$__timeTo()", "now()")
    units = {"h": "hour", "d": "day"}
    sql = re.sub(r"\$__timeGroupAlias\((.*?),\s*'1(\w)'\)", lambda m: f"date_trunc('{units[m[2]]}', {m[1]}) AS time", sql)
    return sql.replace("'$site'", f"'{site}'").replace("'$press'", f"'{press}'")
