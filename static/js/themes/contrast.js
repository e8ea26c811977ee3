// High contrast: black, white, and hues that stay apart for colour-blind eyes.

/** @type {import('../types.js').Theme} */
export const contrast = {
  name: 'contrast',
  css: {
    '--ground': '#000000', '--panel': '#000000', '--panel-2': '#111111', '--edge': '#8a8a8a', '--edge-strong': '#ffffff',
    '--text': '#ffffff', '--text-strong': '#ffffff', '--text-dim': '#d8d8d8', '--accent': '#5ec8ff', '--accent-ink': '#000000',
    '--ok': '#4fe0c0', '--info': '#ffd400', '--info-text': '#ffd400', '--info-ink': '#000000', '--info-soft': '#332b00', '--alarm': '#ff3b3b',
    '--alarm-ink': '#000000', '--alarm-soft': '#4a0000', '--focus': '#ffffff', '--shadow': 'rgba(0,0,0,.8)', '--sim': '#e0b0ff',
  },
  map: {
    ground: '#000000', grass: '#000000', water: '#001426', road: '#111111', apron: '#161616', taxiway: '#262626', shoulder: '#0c0c0c',
    runway: '#444444', runwayEdge: '#ffffff', marking: '#ffffff', building: '#1c1c2a', buildingEdge: '#8888aa', stand: '#555555',
    line: '#555544', hold: '#d0c060', holdBusy: '#ffd400', holdClosed: '#e0b0ff', closed: '#e0b0ff', text: '#c8dcdc',
    textStand: '#a0a0a0', textRunway: '#ffffff', textBuilding: '#b0b0c8', halo: '#000000', radar: '#60ff9f', lowVis: '#5ec8ff',
  },
  ink: {
    aircraft: '#5ec8ff', vehicle: '#7fff7f', unknown: '#ffffff', text: '#ffffff', textDim: '#d8d8d8', leader: '#bbbbbb',
    vector: '#5ec8ff', history: '#a0d8ff', alarm: '#ff3b3b', alarmInk: '#000000', info: '#ffd400', infoInk: '#000000',
    select: '#ffffff', sim: '#e0b0ff', labelBack: 'rgba(0,0,0,0.8)', tool: '#ffffff', toolBack: 'rgba(0,0,0,0.95)', halo: '#000000',
  },
};
