// For a bright tower cab.

/** @type {import('../types.js').Theme} */
export const day = {
  name: 'day',
  css: {
    '--ground': '#dfe5e6', '--panel': '#f3f6f7', '--panel-2': '#e6ecee', '--edge': '#c6d0d5', '--edge-strong': '#9aa9b2',
    '--text': '#24313a', '--text-strong': '#0b141a', '--text-dim': '#51616c', '--accent': '#0b5f96', '--accent-ink': '#ffffff',
    '--ok': '#1b7350', '--info': '#e09a00', '--info-text': '#835000', '--info-ink': '#1d1402', '--info-soft': '#fbeecb', '--alarm': '#cf1f24',
    '--alarm-ink': '#ffffff', '--alarm-soft': '#fbdcdc', '--focus': '#0b5f96', '--shadow': 'rgba(30,45,55,.25)', '--sim': '#5b459c',
  },
  map: {
    ground: '#dde4e1', grass: '#d6dfd8', water: '#bcd5e3', road: '#d0d6d8', apron: '#c9d0d3', taxiway: '#b7c0c5', shoulder: '#cfd6d6',
    runway: '#8d989f', runwayEdge: '#5f6b73', marking: '#f7fafb', building: '#b1b7c0', buildingEdge: '#858e99', stand: '#a9b3b9',
    line: '#97a08f', hold: '#8a6d00', holdBusy: '#b36b00', holdClosed: '#5b459c', closed: '#5b459c', text: '#3f5660',
    textStand: '#6d7b84', textRunway: '#16222a', textBuilding: '#5b6570', halo: '#dde4e1', radar: '#0f6b4a', lowVis: '#3f6f9f',
  },
  ink: {
    aircraft: '#0b4f86', vehicle: '#1c6a35', unknown: '#5a4c33', text: '#0d181f', textDim: '#44545f', leader: '#6f7f89',
    vector: '#2b6f9f', history: '#3f7399', alarm: '#cf1f24', alarmInk: '#ffffff', info: '#f0a800', infoInk: '#1d1402',
    select: '#000000', sim: '#7d6cb0', labelBack: 'rgba(243,246,247,0.78)', tool: '#43307f', toolBack: 'rgba(255,255,255,0.92)', halo: '#eef2f2',
  },
};
